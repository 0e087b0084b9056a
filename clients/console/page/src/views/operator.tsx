/** The name by which other operators know this browser: a place in the settings. */
export function OperatorSetting() {
  return null;
}
