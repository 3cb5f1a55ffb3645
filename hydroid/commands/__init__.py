"""Every command as one function, for the terminal and for Python;
a result knows how it is printed."""
