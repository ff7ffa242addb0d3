"""Small logs of ratings as CSV texts: a good one, and bad ones with the message that they get."""

HEADER = "rater,ratee,rating,time\n"
GOOD = HEADER + "a,x,1,10\nb,x,5,20\na,y,3,30\n"

BAD: dict[str, tuple[str | bytes, tuple[int | str, ...]]] = {
    "wrong columns": (
        GOOD.replace("ratee", "place", 1),
        ("ratee", "rater", "place"),
    ),
    "NaN": (GOOD + "c,x,nan,40\n", (5, "nan")),
    "no number": (GOOD + "c,x,good,40\n", (5, "good")),
    "no rating": (GOOD + "c,x,,40\n", (5,)),
    "off the scale": (GOOD + "c,x,6,40\n", (5, "6")),
    "bad time": (GOOD + "c,x,5,soon\n", (5, "soon")),
    "no name": (GOOD + ",x,5,40\n", (5, "rater")),
    "short row": (GOOD + "c,x\n", (5, "2", "4")),
    "an empty row before a bad one": (GOOD + "\nc,x,good,50\n", (6, "good")),
    "infinite": (GOOD + "c,x,inf,40\n", (5, "inf")),
    "below the scale": (GOOD + "c,x,-1,40\n", (5, "-1")),
    "NaN as time": (GOOD + "c,x,5,nan\n", (5, "nan")),
    "just off the scale": (
        GOOD + "c,x,5.0000001,40\n",
        (5, "5.0000001", "--scale 1 5.0000001"),
    ),
    "no time": (GOOD + "c,x,5,\n", (5,)),
    "a date after numbers": (
        GOOD + "c,x,5,2024-01-31\n",
        (5, "2024-01-31"),
    ),
    "no time at first": (HEADER + "c,x,5,\n", (2,)),
    "now at first": (HEADER + "c,x,5,now\n", (2, "now")),
    **{
        f"{text or 'nothing'} after dates": (
            f"{HEADER}a,x,1,2024-01-30\nb,x,1,2024-01-31T12:00:00\nc,x,5,{text}\nd,x,5,now\n",
            (4, text),
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
    "repeat": (GOOD + "b,x,5,20\n", (5, 3)),
    "nothing": ("", ()),
    "another header": ("who,whom\n", ("rater", "who", "whom")),
    "no ratings": (HEADER, ()),
    "a picture": (b"\x89PNG\r\n\x1a\n\x00\xff\xfe", ("CSV",)),
    "long row": (GOOD + "c,x,5,40,50\n", (5, "5", "4")),
    "a quote without end": (GOOD + 'c,x,5,"40\nd,x,5,50\n', (5,)),
    "a quote without end in another column": (
        GOOD.replace("\n", ",\n") + 'c,x,5,40,"a\nd,x,5,50,b\n',
        (5,),
    ),
}
