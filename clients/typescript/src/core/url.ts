import { printable } from "./bytes.js";
import { defaultPort, pathSizeMax } from "./numbers.js";

/** An object's address (spec/hprotocol.md, section 10). */
export interface Url {
  /** 1 to 8, without brackets; a zone follows `%`. */
  readonly hosts: readonly string[];
  readonly port: number;
  readonly path: string;
}

const scheme = "rtpm://";
const hostCountMax = 8;

/** Whether the text can be an object's path: 1 to 200 bytes, components parted by slashes. */
export function isValidPath(path: string): boolean {
  return path.length <= pathSizeMax && /^[A-Za-z0-9._-]+(\/[A-Za-z0-9._-]+)*$/.test(path);
}

function isIpv4(text: string): boolean {
  const parts = text.split(".");
  return (
    parts.length === 4 && parts.every((part) => /^(0|[1-9]\d{0,2})$/.test(part) && +part < 256)
  );
}

// The number of 16-bit groups; undefined if one is malformed.
function countGroups(text: string, mayEndInIpv4: boolean): number | undefined {
  if (text === "") return 0;
  let count = 0;
  const groups = text.split(":");
  for (const [i, group] of groups.entries()) {
    const isIpv4Here = mayEndInIpv4 && i === groups.length - 1 && isIpv4(group);
    if (!isIpv4Here && !/^[0-9a-fA-F]{1,4}$/.test(group)) return undefined;
    count += isIpv4Here ? 2 : 1;
  }
  return count;
}

/** Whether the text is an IPv6 address without a zone. */
export function isIpv6(text: string): boolean {
  const gap = text.indexOf("::");
  if (gap < 0) return countGroups(text, true) === 8;
  const before = countGroups(text.slice(0, gap), false);
  const after = countGroups(text.slice(gap + 2), true);
  return before !== undefined && after !== undefined && before + after < 8;
}

function readHost(part: string): string | undefined {
  if (/^[A-Za-z0-9._-]+$/.test(part)) return part;
  const found = /^\[([^%\]]*)(?:%25([A-Za-z0-9._-]{1,15}))?\]$/.exec(part);
  const address = found?.[1];
  if (address === undefined || !isIpv6(address)) return undefined;
  return found?.[2] === undefined ? address : `${address}%${found[2]}`;
}

/** undefined if the text is no address (hp-10-1). */
export function parseUrl(text: string): Url | undefined {
  if (!text.startsWith(scheme)) return undefined;
  const slash = text.indexOf("/", scheme.length);
  if (slash < 0) return undefined;
  const authority = text.slice(scheme.length, slash);
  const path = text.slice(slash + 1);
  const colon = authority.lastIndexOf(":");
  if (colon < 0 || !isValidPath(path)) return undefined;
  const portText = authority.slice(colon + 1);
  const port = /^\d{1,6}$/.test(portText) ? Number(portText) : 0;
  if (port < 1 || port > 65535) return undefined;
  const parts = authority.slice(0, colon).split(",");
  if (parts.length > hostCountMax) return undefined;
  const hosts: string[] = [];
  for (const part of parts) {
    const host = readHost(part);
    if (host === undefined) return undefined;
    hosts.push(host);
  }
  return { hosts, port, path };
}

/** The host as an address has it: IPv6 in brackets, its zone behind `%25`. */
export function hostInUrl(host: string): string {
  return host.includes(":") ? `[${host.replace("%", "%25")}]` : host;
}

export function urlText(url: Url): string {
  return `${scheme}${url.hosts.map(hostInUrl).join(",")}:${url.port}/${url.path}`;
}

const registryPath = "rtpm/names";

/**
 * The addresses of registries in a text such as RTPM_REGISTRY, with `,rtpm://` between two of them.
 * @throws RangeError for a text of another form
 */
export function registryAddresses(text: string): string[] {
  return text.split(/,(?=rtpm:)/).map(registryAddress);
}

function registryAddress(text: string): string {
  const isUrl = text.startsWith(scheme);
  const rest = isUrl ? text.slice(scheme.length) : text;
  const slash = isUrl ? rest.indexOf("/") : -1;
  const place = slash < 0 ? rest : rest.slice(0, slash);
  const authority = isIpv6(place) ? `[${place}]` : place;
  const withPort = /:\d+$/.test(authority) ? authority : `${authority}:${defaultPort}`;
  const path = slash < 0 ? registryPath : rest.slice(slash + 1);
  const address = `${scheme}${withPort}/${path}`;
  if (parseUrl(address) !== undefined) return address;
  throw new RangeError(
    `"${printable(text)}" is no address of a registry, in RTPM_REGISTRY or \`registries\`: state ` +
      "host, host:port, [ipv6]:port, rtpm://host, rtpm://host:port or " +
      `rtpm://host:port/${registryPath}`,
  );
}
