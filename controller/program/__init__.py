"""Program text to blocks: words, codes, modal state, each line checked where it stands."""
