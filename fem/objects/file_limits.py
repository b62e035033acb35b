"""What a mesh file may be and how large, known without loading what reads it."""

ENDINGS = (".stl", ".obj", ".ply")
LARGEST_FILE = 200 * 2**20  # bytes
MOST_TRIANGLES = 500_000
MOST_POINTS = 3 * MOST_TRIANGLES  # as many as an STL file has, where every triangle has its own
MOST_CORNERS = 255  # of a face
MOST_LINES = 5_000_000
LONGEST_LINE, LONGEST_NUMBER = 20_000, 60  # bytes
