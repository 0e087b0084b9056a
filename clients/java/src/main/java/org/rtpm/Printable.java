package org.rtpm;

/** Makes text of others safe to print. */
final class Printable {
  private static final int LENGTH_MAX = 300;

  private Printable() {}

  /** The text with control characters and unassigned ones escaped, cut behind 300 characters. */
  static String of(String text) {
    StringBuilder to = new StringBuilder();
    int[] points = text.codePoints().limit(LENGTH_MAX + 1).toArray();
    for (int i = 0; i < Math.min(points.length, LENGTH_MAX); ++i) {
      int point = points[i];
      boolean isSafe =
          point == ' '
              || (Character.isDefined(point)
                  && !Character.isISOControl(point)
                  && !Character.isSpaceChar(point)
                  && Character.getType(point) != Character.FORMAT
                  && Character.getType(point) != Character.SURROGATE
                  && Character.getType(point) != Character.PRIVATE_USE);
      if (isSafe) {
        to.appendCodePoint(point);
      } else {
        to.append(String.format("\\u{%x}", point));
      }
    }
    return points.length > LENGTH_MAX ? to + "…" : to.toString();
  }
}
