import numpy as np
import pytest

import ldls

ROWS = [[1.5, -2, 3e-3], [4, 5, 6]]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        pytest.param("1.5,-2,3e-3\n4,5,6\n", ROWS, id="commas"),
        pytest.param("1.5;-2;3e-3\n4;5;6\n", ROWS, id="semicolons"),
        pytest.param("1.5;-2;3e-3\r4;5;6\r", ROWS, id="line ends of old"),
        pytest.param("x;y;z;name\n1.5;-2;3e-3;car\n4;5;6;bu", ROWS, id="no last line end behind what is not read"),
        pytest.param("1.5 -2 3e-3\n4 5 6 ", ROWS, id="a blank at the end, no line end"),
        pytest.param("1.5\t-2\t3e-3\n4\t5\t6\n", ROWS, id="tabs"),
        pytest.param("  1.5   -2 3e-3\n4 5  6 \n\n", ROWS, id="blanks"),
        pytest.param("1.5, -2, 3e-3\n4, 5, 6\n", ROWS, id="commas and blanks"),
        pytest.param("\ufeff1.5,-2,3e-3\r\n4,5,6\r\n", ROWS, id="byte order mark, CRLF"),
        pytest.param("2\n1.5 -2 3e-3\n4 5 6\n", ROWS, id="the count of points"),
        pytest.param("//X Y Z\n2\n1.5 -2 3e-3\n4 5 6\n", ROWS, id="header and count of CloudCompare"),
        pytest.param("# made by hand\n1.5 -2 3e-3\n// half way\n4 5 6\n", ROWS, id="comments"),
        pytest.param("x,y,z\n1.5,-2,3e-3\n4,5,6\n", ROWS, id="header"),
        pytest.param("//X Y Z\n1.5 -2 3e-3\n4 5 6\n", ROWS, id="header of CloudCompare"),
        pytest.param("# x y z\n1.5 -2 3e-3\n4 5 6\n", ROWS, id="header behind a comment sign"),
        pytest.param("# by hand\n\n# z y x\n3e-3 -2 1.5\n6 5 4\n", ROWS, id="header behind another comment"),
        pytest.param("// by hand\nz,y,x\n3e-3,-2,1.5\n6,5,4\n", ROWS, id="header below a comment"),
        pytest.param("# x ahead y left z up\n1 2 3 4\n", [[1, 2, 3, 4]], id="axes in a comment"),
        pytest.param("# by hand\n# places are x y z in metres\n1.5 -2 3e-3\n4 5 6\n", ROWS, id="a sentence of x y z"),
        pytest.param("# by hand\n# Columns: z y x n\n3 2 1 4\n", [[1, 2, 3]], id="names behind a colon"),
        pytest.param("# Coordinates: x y z\n1 2 3 4\n", [[1, 2, 3, 4]], id="x y z behind a colon"),
        pytest.param("# by hand\n# x y z of cars\nn,z,y,x\n0,3,2,1\n", [[1, 2, 3]], id="a sentence above the header"),
        pytest.param("# x vx y vy z vz\n1\n1 2 3 4 5 6\n", [[1, 3, 5]], id="x y z apart above a count"),
        pytest.param("# x vx y vy z vz\n1 2 3 4 5 6\n", [[1, 3, 5]], id="header behind a comment sign, x y z apart"),
        pytest.param("name;Z;Y;X\ncar;3e-3;-2;1.5\n;6;5;4\n", ROWS, id="header in another order"),
        pytest.param('"x","y","z"\n"1.5","-2","3e-3"\n4,5,6\n', ROWS, id="quotes"),
        pytest.param("intensity x y z ring\n9 1 2 3 7\n", [[1, 2, 3, 9]], id="intensity comes fourth"),
        pytest.param("1 2 3 0.5 7\n", [[1, 2, 3, 0.5, 7]], id="more columns without names"),
        pytest.param("x,y,z\n1.5,-2,3e-3,\n4,5,6\n", ROWS, id="a comma behind the last cell"),
        pytest.param("1.5\t-2\t3e-3\t\n4\t5\t6\t\n", ROWS, id="a tab behind the last cell without names"),
        pytest.param("x y z i\n1 2 3 0.5 parked car\n", [[1, 2, 3, 0.5]], id="more cells of text"),
        pytest.param("1 2 3\n4 5 6 parked car\n", [[1, 2, 3], [4, 5, 6]], id="more cells of text without names"),
        pytest.param("x,y,z,name\n1.0,2.0,3.0,hello, world\n", [[1, 2, 3]], id="a comma in text"),
        pytest.param("x,y,z,i\n1,2,3,0.5,,\n", [[1, 2, 3, 0.5]], id="empty cells"),
        pytest.param('x,y,z\n1,2,3,"", \n', [[1, 2, 3]], id="empty cells in quotes"),
        pytest.param("1 2 3\n4 5 6 # 2 hits\n", [[1, 2, 3], [4, 5, 6]], id="a comment behind a row"),
        pytest.param("x y z\n4 5 6 // 2 hits", [[4, 5, 6]], id="a comment behind a row with names"),
        pytest.param('name,x,y,z\n"a,b",1.5,-2,3e-3\n,4,5,6\n', ROWS, id="a comma in quotes"),
        pytest.param('"t, s",x,y,z,n\n0,1.5,-2,3e-3,7\n1,4,5,6,8\n', ROWS, id="a comma in quotes of the header"),
        pytest.param('"t; s",x,y,z\n"a; b",1.5,-2,3e-3\n,4,5,6\n', ROWS, id="a semicolon in quotes"),
        pytest.param('"t s" "x"  y z n\n0 1.5 -2 3e-3 7\n1 4 5 6 8\n', ROWS, id="a blank in quotes of the header"),
        pytest.param('x, y, "t, s", z\n1.5, -2, 0, 3e-3\n4, 5, 1, 6\n', ROWS, id="a comma in quotes behind a blank"),
        pytest.param('a, b, x, y, z, n\n "5, 6", 7, 1, 2, 3, 9\n', [[1, 2, 3]], id="quotes behind a blank"),
        pytest.param('\t"x"\t"y"\t"z"\n0\t1.5\t-2\t3e-3\n1\t4\t5\t6\n', ROWS, id="a first column without a name"),
        pytest.param("nan 2 inf\n", [[np.nan, 2, np.inf]], id="not finite"),
        pytest.param("x,y,z\n", np.zeros((0, 3)), id="header alone"),
        pytest.param("500000.123456 5000000.654321 1\n", [[500000.123456, 5000000.654321, 1]], id="UTM"),
    ],
)
def test_rows_of_text_are_points(tmp_path, text, expected):
    path = tmp_path / "a.txt"
    path.write_bytes(text.encode())
    points = ldls.read_points(path)
    np.testing.assert_array_equal(points, np.array(expected))
    assert points.dtype == np.float64


@pytest.mark.parametrize("ending", [".csv", ".txt", ".xyz", ".asc", ".pts"])
def test_endings_of_text(tmp_path, ending):
    (tmp_path / f"a{ending}").write_text("1.5 -2 3e-3\n4 5 6\n")
    np.testing.assert_array_equal(ldls.read_points(tmp_path / f"a{ending}"), ROWS)


@pytest.mark.parametrize(
    ("text", "error", "message"),
    [
        pytest.param("1 2 3\n4 oops 6\n", ldls.CorruptFileError, "line 2: .* column 2, got 'oops'", id="word"),
        pytest.param(
            "1 2 3\n\n4 5\n6 7 8\n", ldls.CorruptFileError, "line 3: expected at least 3 cells, got 2", id="short"
        ),
        pytest.param("3\n1 2 3\n4 5 6\n", ldls.TruncatedFileError, "line 1: .* counts 3 points, got 2", id="fewer"),
        pytest.param("9" * 5000 + "\n1 2 3\n", ldls.CorruptFileError, "line 1: expected x y z or", id="huge count"),
        pytest.param("1\n1 2 3\n4 5 6\n", ldls.CorruptFileError, "line 1: .* counts 1 points, got 2", id="more"),
        pytest.param("1 2 3\n4 5", ldls.TruncatedFileError, "line 2: expected at least 3 cells, got 2", id="cut"),
        pytest.param("1_5;2;3\n", ldls.CorruptFileError, "line 1: .* decimal point .* '1_5'", id="underscore"),
        pytest.param("1,5;2;3\n", ldls.CorruptFileError, "line 1: .* decimal point .* '1,5'", id="decimal comma"),
        pytest.param("1,2,3\n1,5,2,3\n", ldls.CorruptFileError, "line 2: expected 3 cells, got 4.* decimal", id="long"),
        pytest.param(
            "1 2 3\n4 5 6\n7 8 9 10\n", ldls.CorruptFileError, "line 3: expected 3 cells, got 4", id="long, blanks"
        ),
        pytest.param(
            "x,y,z\n1,2,3\n4,5,6,7\n", ldls.CorruptFileError, "line 3: expected 3 cells, got 4", id="header, long"
        ),
        pytest.param(
            "x y z r\n1 2 3 4 5\n", ldls.CorruptFileError, "line 2: expected 4 cells, got 5", id="header, blanks"
        ),
        pytest.param(
            'x,y,z,n\n1,2,3,"a,b"\n1,5,2,3,"4"\n', ldls.CorruptFileError, "line 3: expected 4 cells, got 5", id="quotes"
        ),
        pytest.param(
            "1 2 3\n4 5 6 a\n4 b 6\n", ldls.CorruptFileError, "line 3: .* column 2, got 'b'", id="word behind text"
        ),
        pytest.param("1,5;2,5;3,5\n", ldls.CorruptFileError, "decimal point .* '1,5'", id="decimal commas"),
        pytest.param("1,,3\n", ldls.CorruptFileError, "line 1: .* column 2, got ''", id="empty cell"),
        pytest.param(
            "x y z\n1 2\n3 4 5\n", ldls.CorruptFileError, "line 2: expected at least 3 cells", id="header, short"
        ),
        pytest.param(
            "x [m],y [m],z [m]\n1,2,3\n", ldls.CorruptFileError, r"column x is missing; found x \[m\] y", id="units"
        ),
        pytest.param("# by hand\na b c\n1 2 3\n", ldls.CorruptFileError, "line 2: column x is missing", id="below"),
        pytest.param(
            'n,x,y,z\n"a,b",1,oops,3\n',
            ldls.CorruptFileError,
            "line 2: .* column 3, got 'oops'",
            id="word behind quotes",
        ),
        pytest.param("x_m y_m z_m\n1 2 3\n", ldls.CorruptFileError, "column x is missing; found x_m y_m", id="names"),
        pytest.param("x y z X\n", ldls.CorruptFileError, "column x is there 2 times", id="name twice"),
        pytest.param("# nothing\n", ldls.TruncatedFileError, "only comments", id="comments"),
        pytest.param("\n \n", ldls.TruncatedFileError, "empty", id="blank"),
        pytest.param("1 " * 65, ldls.UnsupportedFormatError, "65 columns, expected at most 64", id="wide"),
    ],
)
def test_faults_of_text_are_named_with_their_line(tmp_path, text, error, message):
    path = tmp_path / "a.csv"
    path.write_text(text)
    with pytest.raises(error, match=f"a.csv.*{message}"):
        ldls.read_points(path)


def test_text_that_is_none_is_refused(tmp_path):
    (tmp_path / "a.xyz").write_bytes(b"1 2 3\n\xff\xfe\n")
    with pytest.raises(ldls.CorruptFileError, match="not a text file"):
        ldls.read_points(tmp_path / "a.xyz")
