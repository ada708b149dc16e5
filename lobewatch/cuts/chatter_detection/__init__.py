"""What cuts sound like: which parts of a recording they are, true speed, chatter or not; arrays in, a record out."""
