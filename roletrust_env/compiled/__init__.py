"""The optional compiled engine: it records the rules of a game once, and LLVM compiles them."""
