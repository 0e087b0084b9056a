import {useRef} from 'preact/hooks';
import {useApp} from '../store/app';
import {kHoldsLease, type Command} from '../store/commands';
import {freshness, type Device} from '../model/state';
import {Badge, Card, Confirm, Notice} from '../parts/parts';
import {Age, LeaseText, Lifecycle} from './device_status';

/** A device's lifecycle, lease and faults, and the commands that change them. */
export function CommandCard({name, device}: {name: string; device: Device | null}) {
  const app = useApp();
  if (device === null) {
    return (
      <Card title={name}>
        <Notice tone="warn" role="status">
          {name} is not at the registry{app.isLive.value ? '' : ', as far as was known'}. It shows
          again as soon as it is back.
        </Notice>
      </Card>
    );
  }
  return (
    <Card title={name} aside={<Age device={device} isLive={app.isLive.value} />} class="live-zone">
      <dl class="facts">
        <div>
          <dt>State</dt>
          <dd data-testid="lifecycle">
            <Lifecycle device={device} />
          </dd>
        </div>
        <div>
          <dt>Lease</dt>
          <dd data-testid="lease">
            <LeaseText device={device} />
          </dd>
        </div>
        <div>
          <dt>Faults</dt>
          <dd data-testid="faults">
            {device.faults.length === 0 ? (
              <span class="quiet">none</span>
            ) : (
              device.faults.map((one) => (
                <Badge key={one} tone="warn">
                  {one}
                </Badge>
              ))
            )}
          </dd>
        </div>
      </dl>
      {device.problem !== '' && <p class="problem">{device.problem}</p>}
      <Buttons device={device} />
      <Outcome device={device} />
    </Card>
  );
}

function Buttons({device}: {device: Device}) {
  const app = useApp();
  const mayCommand = app.isLive.value && app.mayCommand.value;
  const isReachable = mayCommand && freshness(device) !== 'lost';
  const isIdle = isReachable && !app.commands.pending.value.has(device.name);
  const isOurs = device.lease.state === 'held by this console';
  const isHeld = device.lease.state === 'held';
  const run = (command: Command) => () => void app.commands.run(command, device.name);
  return (
    <>
      {!app.mayCommand.value && app.isLive.value && (
        <p class="quiet small">Read only: open the URL with the token that rtpm-console printed.</p>
      )}
      <div class="buttons">
        {isHeld ? (
          <Confirm
            label="Take over"
            disabled={!isIdle}
            confirm="Take over"
            question={
              `Another client commands ${device.name}. Its force falls to zero, and its ` +
              'commands are refused from then on.'
            }
            onConfirm={run('take_over')}
          />
        ) : (
          <button type="button" disabled={!isIdle || isOurs} onClick={run('take_over')}>
            Take over
          </button>
        )}
        <button type="button" disabled={!isIdle || !isOurs} onClick={run('release')}>
          Release
        </button>
        <button
          type="button"
          disabled={!isIdle || device.lifecycle !== 'inactive'}
          onClick={run('activate')}
        >
          Activate
        </button>
        <button
          type="button"
          disabled={!isIdle || device.lifecycle !== 'active'}
          onClick={run('deactivate')}
        >
          Deactivate
        </button>
        <button type="button" disabled={!isIdle} onClick={run('recover')}>
          Recover
        </button>
        {device.isStopped && (
          <Confirm
            label="Rearm"
            disabled={!isIdle}
            confirm={`Rearm ${device.name}`}
            question={
              'Is the cause removed, and is nobody in reach who does not expect force? The ' +
              'force returns slowly after this.'
            }
            onConfirm={run('rearm')}
          />
        )}
        <button
          type="button"
          class="danger"
          disabled={!mayCommand}
          onClick={() => void app.stop.press(device.name)}
        >
          Stop {device.name}
        </button>
      </div>
    </>
  );
}

function Outcome({device}: {device: Device}) {
  const app = useApp();
  const refusal = app.commands.refusals.value.get(device.name);
  const words = useDone(device, app.commands.done.value.get(device.name));
  if (refusal !== undefined) {
    return (
      <Notice tone="bad" role="alert">
        {refusal.words}{' '}
        {refusal.isForceable && (
          <button
            type="button"
            onClick={() => void app.commands.run('take_over', device.name, true)}
          >
            Take over all the same
          </button>
        )}
        <button type="button" onClick={() => app.commands.forget(device.name)}>
          Dismiss
        </button>
      </Notice>
    );
  }
  return (
    <p class="quiet small" role="status">
      {words}
    </p>
  );
}

/** What was done last, as long as it is so: a lease may have ended since. */
function useDone(device: Device, done: string | undefined): string {
  const isOurs = device.lease.state === 'held by this console';
  // The state that shows the lease follows the answer a moment later.
  const wasOurs = useRef(false);
  wasOurs.current = done === kHoldsLease && (wasOurs.current || isOurs);
  if (done === undefined) return '';
  if (done !== kHoldsLease) return `Done: ${done}.`;
  if (wasOurs.current && !isOurs) return 'The lease of this console has ended.';
  return `Done: ${done}. It lasts until it is released.`;
}
