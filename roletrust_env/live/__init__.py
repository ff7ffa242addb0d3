"""The live system: the same trust code on the wire, with cameras, raters and a manager as processes of their own."""
