"""Lines over numbers, as SVG: what the pictures of the page have in common."""

import math

COLOURS = ("#2471a3", "#c0392b", "#2ca02c", "#d68910", "#7d3c98")


def nice(top):
    """The least of 1, 2, 5 times a power of ten that is no less."""
    power = 10.0 ** math.floor(math.log10(top))
    return next(k * power for k in (1, 2, 5, 10) if k * power >= top * (1 - 1e-12))


class Panel:
    """Axes in a rectangle; draws into a list of SVG elements."""

    def __init__(self, parts, box, x_range, y_range, title, x_title=""):
        self.parts, self.box, self.x_range, self.y_range = parts, box, x_range, y_range
        left, top, width, height = box
        parts.append(f'<rect x="{left}" y="{top}" width="{width}" height="{height}" fill="none" '
                     'stroke="#bbb"/>'
                     f'<text x="{left}" y="{top - 8}" font-size="14">{title}</text>'
                     f'<text x="{left + width / 2}" y="{top + height + 32}" '
                     f'text-anchor="middle">{x_title}</text>')
        for k in range(5):
            for low, high, at in ((*x_range, 0), (*y_range, 1)):
                value = low + k * (high - low) / 4
                x, y = self.place(value, y_range[0]) if at == 0 else self.place(x_range[0], value)
                anchor = ' text-anchor="middle"' if at == 0 else ' text-anchor="end"'
                dx, dy = (0, 16) if at == 0 else (-5, 4)
                parts.append(f'<text x="{x + dx:.1f}" y="{y + dy:.1f}"{anchor}>{value:.4g}</text>')

    def place(self, x, y):
        left, top, width, height = self.box
        (x0, x1), (y0, y1) = self.x_range, self.y_range
        return (left + (x - x0) / (x1 - x0) * width, top + height - (y - y0) / (y1 - y0) * height)

    def line(self, points, colour, wide=1.5, dash=""):
        step = max(1, len(points) // 400)
        points = points[::step] + points[-1:]
        inside = [(min(max(x, self.x_range[0]), self.x_range[1]),
                   min(max(y, self.y_range[0]), self.y_range[1])) for x, y in points]
        at = " ".join("{:.1f},{:.1f}".format(*self.place(x, y)) for x, y in inside)
        dashes = f' stroke-dasharray="{dash}"' if dash else ""
        self.parts.append(f'<polyline points="{at}" fill="none" stroke="{colour}" '
                          f'stroke-width="{wide}"{dashes}/>')

    def dot(self, x, y, colour, radius=2.0):
        px, py = self.place(x, y)
        self.parts.append(f'<circle cx="{px:.1f}" cy="{py:.1f}" r="{radius}" fill="{colour}"/>')

    def ellipse(self, x, y, axes, turn, colour, dash=""):
        """`axes` in the units of the axes, whose scales must be equal; `turn` in radians."""
        px, py = self.place(x, y)
        scale = self.box[2] / (self.x_range[1] - self.x_range[0])
        dashes = f' stroke-dasharray="{dash}"' if dash else ""
        self.parts.append(f'<ellipse cx="0" cy="0" rx="{axes[0] * scale:.2f}" ry="{axes[1] * scale:.2f}" '
                          f'transform="translate({px:.2f} {py:.2f}) rotate({-math.degrees(turn):.2f})" '
                          f'fill="none" stroke="{colour}"{dashes}/>')


def legend(parts, x, y, names, step=190):
    for k, (name, colour, dash) in enumerate(names):
        dashes = f' stroke-dasharray="{dash}"' if dash else ""
        parts.append(f'<line x1="{x + step * k}" x2="{x + step * k + 24}" y1="{y - 4}" y2="{y - 4}" '
                     f'stroke="{colour}" stroke-width="2"{dashes}/>'
                     f'<text x="{x + step * k + 30}" y="{y}">{name}</text>')


def write(path, width, height, parts):
    head = (f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" '
            'font-family="sans-serif" font-size="12">\n<rect width="100%" height="100%" fill="white"/>\n')
    path.write_text(head + "\n".join(parts) + "\n</svg>\n")
