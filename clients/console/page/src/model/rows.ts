/** The first of `count` rows, ordered by time, at or after `timeS`; `count` if there is none. */
export function rowAtOrAfter(
  count: number,
  timeAt: (row: number) => number,
  timeS: number,
): number {
  let low = 0;
  let high = count;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (timeAt(middle) < timeS) low = middle + 1;
    else high = middle;
  }
  return low;
}
