"""Bad input and the line it gets, as a page: each entry is tried when the page is made."""
