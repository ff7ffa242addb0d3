"""Small logs of ratings as CSV texts: a good one, and bad ones with the message that they get."""

HEADER = "rater,ratee,rating,time\n"
GOOD = HEADER + "a,x,1,10\nb,x,5,20\na,y,3,30\n"

BAD: dict[str, tuple[str | bytes, str]] = {
    "wrong columns": (
        GOOD.replace("ratee", "place", 1),
        r"no column 'ratee'; did you mean 'rater'\? Columns: rater, place, rating, time; name or number it",  # noqa: E501
    ),
    "NaN": (GOOD + "c,x,nan,40\n", "row 5: the rating is 'nan'; it must be a number"),
    "no number": (GOOD + "c,x,good,40\n", "row 5: the rating is 'good'"),
    "no rating": (GOOD + "c,x,,40\n", "row 5: the rating is ''"),
    "off the scale": (GOOD + "c,x,6,40\n", "row 5: the rating is 6, off the scale from 1 to 5"),
    "bad time": (GOOD + "c,x,5,soon\n", "row 5: the time is 'soon'"),
    "no name": (GOOD + ",x,5,40\n", "row 5 has no name in column 'rater'"),
    "short row": (GOOD + "c,x\n", "row 5 has 2 columns; 4 are needed"),
    "an empty row before a bad one": (GOOD + "\nc,x,good,50\n", "row 6: the rating is 'good'"),
    "infinite": (GOOD + "c,x,inf,40\n", "row 5: the rating is 'inf'; it must be a number"),
    "below the scale": (GOOD + "c,x,-1,40\n", "row 5: the rating is -1, off the scale from 1 to 5"),
    "NaN as time": (GOOD + "c,x,5,nan\n", "row 5: the time is 'nan'; it must be a number"),
    "just off the scale": (
        GOOD + "c,x,5.0000001,40\n",
        r"row 5: the rating is 5\.0000001, off .* --scale 1 5\.0000001",
    ),
    "no time": (GOOD + "c,x,5,\n", "row 5: the time is ''; it must be a number"),
    "a date after numbers": (
        GOOD + "c,x,5,2024-01-31\n",
        "row 5: the time is '2024-01-31'; it must be a number",
    ),
    "no time at first": (HEADER + "c,x,5,\n", "row 2: the time is ''; it must be a number"),
    "now at first": (HEADER + "c,x,5,now\n", "row 2: the time is 'now'; it must be a number"),
    **{
        f"{text or 'nothing'} after dates": (
            f"{HEADER}a,x,1,2024-01-30\nb,x,1,2024-01-31T12:00:00\nc,x,5,{text}\nd,x,5,now\n",
            f"row 4: the time is '{text}'; it must be a date of ISO 8601, as in the rows above",
        )
        for text in (
            "",
            "NaT",
            "today",
            "now",
            "2024",
            "20240131",
            "1706659200",
            "-1",
            "2024-13-01",
            "1e-5",
        )
    },
    "repeat": (GOOD + "b,x,5,20\n", "row 5 repeats row 3"),
    "nothing": ("", "has no ratings"),
    "another header": ("who,whom\n", r"row 1: there is no column 'rater'\. Columns: who, whom"),
    "no ratings": (HEADER, "has no ratings"),
    "a picture": (b"\x89PNG\r\n\x1a\n\x00\xff\xfe", "no CSV file: its beginning is no text"),
    "long row": (GOOD + "c,x,5,40,50\n", "row 5 has 5 columns; 4 are needed, as in the rows above"),
    "a quote without end": (GOOD + 'c,x,5,"40\nd,x,5,50\n', "row 5: a quote has no end"),
    "a quote without end in another column": (
        GOOD.replace("\n", ",\n") + 'c,x,5,40,"a\nd,x,5,50,b\n',
        "row 5: a quote has no end",
    ),
}
