/** The token that rtpm-console printed: kept for this tab, and taken out of the visible address. */
const kKey = 'rtpm.token';

export function takeToken(): string | null {
  const address = new URL(window.location.href);
  const token = address.searchParams.get('token');
  if (token !== null) {
    sessionStorage.setItem(kKey, token);
    address.searchParams.delete('token');
    window.history.replaceState(null, '', address);
  }
  return sessionStorage.getItem(kKey);
}

export function socketUrl(token: string | null): string {
  const address = new URL(window.location.href);
  const scheme = address.protocol === 'https:' ? 'wss:' : 'ws:';
  const query = token === null ? '' : `?token=${encodeURIComponent(token)}`;
  // `npm run dev` serves the sources alone, beside the mock.
  const host = import.meta.env.DEV ? '127.0.0.1:8765' : address.host;
  return `${scheme}//${host}/${query}`;
}
