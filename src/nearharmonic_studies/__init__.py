"""What goes beyond the paper: each study is a folder that can be deleted."""
