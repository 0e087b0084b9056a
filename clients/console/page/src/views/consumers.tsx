import {slowestFirst} from '../model/groups';
import type {Consumer} from '../model/state';
import {Badge, Card} from '../parts/parts';
import {Column} from '../parts/popup';
import {duration, rate, thousands} from '../parts/text';
import {texts} from '../texts/texts';

/** A consumer whose oldest waiting event is older is slow. */
const kSlowMs = 100;

/** The programs that receive events, the slowest first. */
export function Consumers({consumers}: {consumers: readonly Consumer[]}) {
  const words = texts.value.consumers;
  if (consumers.length === 0) return null;
  return (
    <Card title={words.title}>
      <div class="scroll" tabIndex={0} role="region" aria-label={words.title}>
        <table>
          <thead>
            <tr>
              <Column name={words.name} />
              <Column name={words.host} />
              <Column name={words.lag} help={words.lagHelp} isNumber />
              <Column name={words.waiting} help={words.waitingHelp} isNumber />
              <Column name={words.delivered} help={words.deliveredHelp} isNumber />
              <Column name={words.dropped} help={words.droppedHelp} isNumber />
            </tr>
          </thead>
          <tbody>
            {slowestFirst(consumers).map((one, i) => (
              <tr key={`${one.name} ${one.host} ${i}`}>
                <th scope="row">
                  {one.name} {one.program !== '' && <span class="quiet">{one.program}</span>}{' '}
                  {one.isSuspended && <Badge tone="warn">{words.suspended}</Badge>}
                </th>
                <td>{one.host === '' ? '–' : one.host}</td>
                <td class={`number ${(one.lagMs ?? 0) > kSlowMs ? 'is-warn' : ''}`}>
                  {one.lagMs === null ? '–' : duration(one.lagMs / 1000)}
                </td>
                <td class="number">{thousands(one.waitingCount)}</td>
                <td class="number">{rate(one.deliveredPerSecond)}</td>
                <td class={`number ${one.droppedCount > 0 ? 'is-warn' : ''}`}>
                  {thousands(one.droppedCount)}
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </Card>
  );
}
