import {useRef} from 'preact/hooks';
import {useApp} from '../store/app';
import type {Command} from '../store/commands';
import {freshness, type Device} from '../model/state';
import {Badge, Card, Confirm, Notice} from '../parts/parts';
import {texts} from '../texts/texts';
import {Age, holderText, LeaseText, Lifecycle} from './device_status';
import {OperatorForm} from './operator';

/** A device's lifecycle, lease and faults, and the commands that change them. */
export function CommandCard({name, device}: {name: string; device: Device | null}) {
  const app = useApp();
  const words = texts.value.commands;
  if (device === null) {
    return (
      <Card title={name}>
        <Notice tone="warn" role="status">
          {app.isLive.value ? words.notThere(name) : words.notThereNow(name)}
        </Notice>
      </Card>
    );
  }
  return (
    <Card title={name} aside={<Age device={device} isLive={app.isLive.value} />} class="live-zone">
      <dl class="facts">
        <div>
          <dt>{words.state}</dt>
          <dd data-testid="lifecycle">
            <Lifecycle device={device} />
          </dd>
        </div>
        <div>
          <dt>{words.lease}</dt>
          <dd data-testid="lease">
            <LeaseText device={device} />
          </dd>
        </div>
        <div>
          <dt>{words.faults}</dt>
          <dd data-testid="faults">
            {device.faults.length === 0 ? (
              <span class="quiet">{words.none}</span>
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
      <Holding device={device} />
      <Outcome device={device} />
    </Card>
  );
}

function Buttons({device}: {device: Device}) {
  const app = useApp();
  const words = texts.value.commands;
  const mayCommand = app.isLive.value && app.mayCommand.value;
  const isReachable = mayCommand && freshness(device) !== 'lost';
  const isIdle = isReachable && !app.commands.pending.value.has(device.name);
  const isOurs = app.operator.holds(device);
  const isHeld = !isOurs && device.lease.state.startsWith('held');
  const isInConsole = device.lease.state === 'held by this console';
  const run = (command: Command, isForced = false) => {
    return () => void app.commands.run(command, device.name, isForced);
  };
  const mayAsk = isInConsole && !isOurs && device.lease.operator?.isGone === false;
  return (
    <>
      {!app.mayCommand.value && app.isLive.value && <p class="quiet small">{words.readOnly}</p>}
      <div class="buttons">
        {mayAsk && (
          <button
            type="button"
            class="strong"
            disabled={!isIdle || app.operator.asked.value.get(device.name) === 'waits'}
            onClick={() => void app.operator.ask(device.name)}
          >
            {texts.value.lease.ask}
          </button>
        )}
        {isHeld ? (
          <Confirm
            label={words.takeOver}
            disabled={!isIdle}
            confirm={words.takeOver}
            question={words.takeOverQuestion(holderText(device), device.name)}
            onConfirm={run('take_over', isInConsole)}
          />
        ) : (
          <button type="button" disabled={!isIdle || isOurs} onClick={run('take_over')}>
            {words.takeOver}
          </button>
        )}
        <button type="button" disabled={!isIdle || !isOurs} onClick={run('release')}>
          {words.release}
        </button>
        <button
          type="button"
          disabled={!isIdle || device.lifecycle !== 'inactive'}
          onClick={run('activate')}
        >
          {words.activate}
        </button>
        <button
          type="button"
          disabled={!isIdle || device.lifecycle !== 'active'}
          onClick={run('deactivate')}
        >
          {words.deactivate}
        </button>
        <button type="button" disabled={!isIdle} onClick={run('recover')}>
          {words.recover}
        </button>
        {device.isStopped && (
          <Confirm
            label={words.rearm}
            disabled={!isIdle}
            confirm={words.rearmOne(device.name)}
            question={words.rearmQuestion}
            onConfirm={run('rearm')}
          />
        )}
        <button
          type="button"
          class="danger"
          disabled={!mayCommand}
          onClick={() => void app.stop.press(device.name)}
        >
          {words.stop(device.name)}
        </button>
      </div>
    </>
  );
}

/** The operator of a device may keep its lease; shows how a request for it ended. */
function Holding({device}: {device: Device}) {
  const {operator} = useApp();
  const words = texts.value.lease;
  const asked = operator.asked.value.get(device.name);
  const isOurs = operator.holds(device) && device.lease.operator !== null;
  return (
    <>
      {isOurs && operator.name.value === '' && (
        <div class="small">
          <p class="quiet">{texts.value.operator.unnamed}</p>
          <OperatorForm />
        </div>
      )}
      {isOurs && (
        <label class="check">
          <input
            type="checkbox"
            checked={device.lease.operator?.isKept ?? false}
            onChange={(event) => void operator.keep(device.name, event.currentTarget.checked)}
          />
          <span>{words.keepLabel}</span>
        </label>
      )}
      {asked === 'waits' && (
        <Notice tone="accent" role="status">
          {words.waits(device.lease.operator?.name || words.itsOperator)}
        </Notice>
      )}
      {asked !== undefined && asked !== 'waits' && (
        <Notice tone={asked === 'granted' ? 'good' : 'warn'} role="status">
          {asked === 'granted' ? words.granted : `${asked.why}.`}{' '}
          <button type="button" onClick={() => operator.forget(device.name)}>
            {texts.value.commands.dismiss}
          </button>
        </Notice>
      )}
    </>
  );
}

function Outcome({device}: {device: Device}) {
  const app = useApp();
  const words = texts.value.commands;
  const refusal = app.commands.refusals.value.get(device.name);
  const done = useDone(device, app.commands.done.value.get(device.name));
  if (refusal !== undefined) {
    return (
      <Notice tone="bad" role="alert">
        {refusal.words}{' '}
        {refusal.isForceable && (
          <button
            type="button"
            onClick={() => void app.commands.run('take_over', device.name, true)}
          >
            {words.takeOverAnyway}
          </button>
        )}
        <button type="button" onClick={() => app.commands.forget(device.name)}>
          {words.dismiss}
        </button>
      </Notice>
    );
  }
  return (
    <p class="quiet small" role="status">
      {done}
    </p>
  );
}

/** The last command, as long as its effect lasts: a lease may have ended since. */
function useDone(device: Device, done: Command | undefined): string {
  const words = texts.value.commands;
  const isOurs = useApp().operator.holds(device);
  // The state that shows the lease follows the answer a moment later.
  const wasOurs = useRef(false);
  wasOurs.current = done === 'take_over' && (wasOurs.current || isOurs);
  if (done === undefined) return '';
  if (done !== 'take_over') return words.done(texts.value.effects[done]);
  if (wasOurs.current && !isOurs) return words.leaseEnded;
  return words.doneLease(texts.value.effects[done]);
}
