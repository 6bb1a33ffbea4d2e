"""The answer: its data, words, pictures and page."""
