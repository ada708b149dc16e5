"""Quality of fitted modes: figures, remarks, trust."""
