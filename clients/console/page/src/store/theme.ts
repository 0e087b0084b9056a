import {effect, signal} from '@preact/signals';
import {recall, remember} from './kept';

/** Light or dark: as the system wants it, or as chosen here. */
export type Theme = 'system' | 'light' | 'dark';

const kKey = 'rtpm.theme';
export const kThemes: readonly Theme[] = ['system', 'light', 'dark'];
const stored = kThemes.find((one) => one === recall(kKey));
const systemDark = window.matchMedia('(prefers-color-scheme: dark)');
const isSystemDark = signal(systemDark.matches);

export const theme = signal<Theme>(stored ?? 'system');
/** Counts changes, for what paints by itself. */
export const themeVersion = signal(0);
const colours = new Map<string, string>();

systemDark.addEventListener('change', (event) => (isSystemDark.value = event.matches));

effect(() => {
  const isDark = theme.value === 'dark' || (theme.value === 'system' && isSystemDark.value);
  document.documentElement.dataset['theme'] = isDark ? 'dark' : 'light';
  remember(kKey, theme.value);
  colours.clear();
  themeVersion.value = themeVersion.peek() + 1;
});

/** A colour of the style sheet, as it is now; read once for each theme. */
export function colour(name: string): string {
  const known = colours.get(name);
  if (known !== undefined) return known;
  const read = getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  colours.set(name, read);
  return read;
}
