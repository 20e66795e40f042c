"""What a program will do, told before it runs, and kept."""
