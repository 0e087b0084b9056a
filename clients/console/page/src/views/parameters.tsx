import {useEffect, useState} from 'preact/hooks';
import {useApp} from '../store/app';
import {writeRoute} from '../store/route';
import type {Form} from '../forms/form';
import {folderOf} from '../model/groups';
import type {Parameter} from '../forms/parameter';
import {Badge, Card, Confirm, Empty, Notice} from '../parts/parts';
import {texts} from '../texts/texts';
import {CalibrationPanel} from './calibration';
import {Field} from './field';

/** Changes are told by the server; this catches what is not. */
const kRefreshMs = 2000;
/** Up to this number, names have a link each; more are in a list. */
const kLinkMax = 12;

/** The parameters of a device or a program, as a form made of their descriptions. */
export function ParametersView() {
  const app = useApp();
  const {subject} = app.route.value;
  const names = app.configurable.value;
  const name = subject !== '' ? subject : names[0];
  if (name === undefined) {
    return (
      <Empty>
        {app.mayCommand.value || !app.isLive.value
          ? texts.value.parameters.none
          : texts.value.parameters.needsToken}
      </Empty>
    );
  }
  const known = names.includes(name) ? names : [...names, name];
  return (
    <div class="parameters">
      <div class="picker">
        {known.length > kLinkMax ? (
          <Names names={known} chosen={name} />
        ) : (
          <nav class="choice" aria-label={texts.value.parameters.of}>
            {known.map((one) => (
              <a
                key={one}
                href={writeRoute('parameters', one)}
                {...(one === name ? {'aria-current': 'true' as const} : {})}
              >
                {one}
              </a>
            ))}
          </nav>
        )}
      </div>
      <FormCard key={name} form={app.form(name)} />
    </div>
  );
}

/** Many names, by folder. */
function Names({names, chosen}: {names: readonly string[]; chosen: string}) {
  const folders = [...new Set(names.map(folderOf))];
  return (
    <label class="names">
      {texts.value.parameters.of}
      <select
        value={chosen}
        onChange={(event) =>
          (window.location.hash = writeRoute('parameters', event.currentTarget.value))
        }
      >
        {folders.map((folder) => (
          <optgroup key={folder} label={folder}>
            {names
              .filter((name) => folderOf(name) === folder)
              .map((name) => (
                <option key={name} value={name}>
                  {name}
                </option>
              ))}
          </optgroup>
        ))}
      </select>
    </label>
  );
}

function useRefresh(form: Form): void {
  const app = useApp();
  const isServed = app.link.services.value.has(`${form.name}/config/list`);
  useEffect(() => {
    if (!isServed) return undefined;
    void form.refresh();
    const timer = setInterval(() => {
      if (!document.hidden && !form.isBusy.peek()) void form.refresh();
    }, kRefreshMs);
    return () => clearInterval(timer);
  }, [form, isServed]);
  const list = form.list.value;
  useEffect(() => {
    if (list !== null) app.link.watch(list.parameters.map((one) => `${form.name}.${one.name}`));
  }, [form, list]);
}

function FormCard({form}: {form: Form}) {
  const app = useApp();
  useRefresh(form);
  const [isCalibrating, setCalibrating] = useState(false);
  const words = texts.value.parameters;
  const list = form.list.value;
  const isServed = app.link.services.value.has(`${form.name}/config/list`);
  if (list === null) {
    return (
      <Card title={form.name}>
        {form.problem.value !== '' ? (
          <Notice tone="bad" role="alert">
            {form.problem.value}
          </Notice>
        ) : (
          <Empty>{isServed ? words.reading : words.notThere(form.name)}</Empty>
        )}
      </Card>
    );
  }
  const isUsable = isServed && app.isLive.value;
  return (
    <div class="form-grid">
      <Card
        title={form.name}
        class={isUsable ? '' : 'is-dead'}
        aside={
          <span class="quiet small">
            {list.model}, {list.serial}
            {` · ${list.isActive ? words.active : words.inactive}`}
            {list.isUnsaved && (
              <>
                {' '}
                · <Badge tone="warn">{words.unsaved}</Badge>
              </>
            )}
          </span>
        }
      >
        {!isServed && app.isLive.value && (
          <Notice tone="warn" role="alert">
            {words.gone(form.name)}
          </Notice>
        )}
        {form.problem.value !== '' && isUsable && (
          <Notice tone="warn" role="alert">
            {words.notRead(form.problem.value)}
          </Notice>
        )}
        <Groups form={form} parameters={list.parameters} />
        <Footer form={form} isUsable={isUsable} />
      </Card>
      <CalibrationPanel name={form.name} isOpen={isCalibrating} setOpen={setCalibrating} />
    </div>
  );
}

/** "safety.ramp_s" belongs to the group "safety". */
function groupOf(parameter: Parameter): string {
  const dot = parameter.name.indexOf('.');
  return dot < 0 ? '' : parameter.name.slice(0, dot);
}

function Groups({form, parameters}: {form: Form; parameters: readonly Parameter[]}) {
  const groups = [...new Set(parameters.map(groupOf))];
  return (
    <>
      {groups.map((group) => (
        <fieldset key={group} class="group">
          <legend>{group === '' ? texts.value.parameters.general : group}</legend>
          <div class="fields">
            {parameters
              .filter((one) => groupOf(one) === group)
              .map((one) => (
                <Field key={one.name} form={form} parameter={one} />
              ))}
          </div>
        </fieldset>
      ))}
    </>
  );
}

function Footer({form, isUsable}: {form: Form; isUsable: boolean}) {
  const list = form.list.value;
  const changeCount = form.changes.value.length;
  const invalidCount = form.invalidCount.value;
  const isBlocked = !isUsable || form.isBusy.value;
  const verdict = form.verdict.value;
  const words = texts.value.parameters;
  return (
    <div class="form-foot">
      {verdict !== null && (
        <Notice tone={verdict.isGood ? 'good' : 'bad'} role={verdict.isGood ? 'status' : 'alert'}>
          {verdict.words}
        </Notice>
      )}
      {invalidCount > 0 && <p class="problem">{words.invalid(invalidCount)}</p>}
      <div class="row">
        <button
          type="button"
          class="strong"
          data-testid="apply"
          disabled={isBlocked || changeCount === 0 || invalidCount > 0}
          onClick={() => void form.apply()}
        >
          {changeCount === 0 ? words.apply : words.applyChanges(changeCount)}
        </button>
        <button
          type="button"
          disabled={form.drafts.value.size === 0}
          onClick={() => form.discard()}
        >
          {words.discard}
        </button>
        <span class="spring" />
        <Confirm
          label={words.resetAll}
          disabled={isBlocked}
          confirm={words.resetAll}
          question={words.resetQuestion(form.name)}
          onConfirm={() => void form.reset(null)}
        />
        <button
          type="button"
          disabled={isBlocked || list?.isPersistent !== true}
          onClick={() => void form.save()}
        >
          {words.save}
        </button>
      </div>
      {list?.isPersistent === false && <p class="quiet small">{words.notPersistent}</p>}
    </div>
  );
}
