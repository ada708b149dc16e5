"""What a cut sounds like: which part of a recording it is, the true speed, chatter or not; arrays in, a record out."""
