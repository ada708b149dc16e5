"""The modes of one recorded file: which hits count, which windows lie over them, the fit."""
