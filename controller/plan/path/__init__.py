"""The way of a whole program: chains of motion, with what is said and waited for between them."""
