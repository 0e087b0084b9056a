import {effect, signal} from '@preact/signals';

/** Light or dark: as the system wants it, or as chosen here. */
export type Theme = 'system' | 'light' | 'dark';

const kKey = 'rtpm.theme';
const kThemes: readonly Theme[] = ['system', 'light', 'dark'];
const stored = kThemes.find((one) => one === localStorage.getItem(kKey));
const systemDark = window.matchMedia('(prefers-color-scheme: dark)');
const isSystemDark = signal(systemDark.matches);

export const theme = signal<Theme>(stored ?? 'system');
/** Counts changes, for what paints by itself. */
export const themeVersion = signal(0);

systemDark.addEventListener('change', (event) => (isSystemDark.value = event.matches));

effect(() => {
  const isDark = theme.value === 'dark' || (theme.value === 'system' && isSystemDark.value);
  document.documentElement.dataset['theme'] = isDark ? 'dark' : 'light';
  localStorage.setItem(kKey, theme.value);
  themeVersion.value = themeVersion.peek() + 1;
});

export function nextTheme(): void {
  const at = kThemes.indexOf(theme.value);
  theme.value = kThemes[(at + 1) % kThemes.length] ?? 'system';
}

/** A colour of the style sheet, as it is now. */
export function colour(name: string): string {
  return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
}
