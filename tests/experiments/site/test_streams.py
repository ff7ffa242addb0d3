"""What a cell printed is shown as it was printed."""

from nbformat.v4 import new_output

from roletrust_experiments.site.streams import whole_streams


def test_lines_that_came_in_pieces_are_whole():
    pieces = ["rank  sc", "ore\n1  0.9", "6\n"]
    picture = new_output("display_data", {"image/png": ""})
    outputs = [*(new_output("stream", name="stdout", text=piece) for piece in pieces), picture]
    outputs.insert(1, new_output("stream", name="stderr", text="careful\n"))
    printed, said, shown = whole_streams(outputs)
    assert (printed["text"], said["text"], shown) == ("rank  score\n1  0.96\n", "careful\n", picture)
