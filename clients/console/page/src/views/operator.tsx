import {useState} from 'preact/hooks';
import {useApp} from '../store/app';
import {kNameMax} from '../store/operator';
import {texts} from '../texts/texts';

/** The name by which other operators know this browser: a place in the settings. */
export function OperatorSetting() {
  return (
    <div class="setting">
      <span>{texts.value.operator.title}</span>
      <OperatorForm />
    </div>
  );
}

/** Name and room; kept in this browser. */
export function OperatorForm() {
  const {operator} = useApp();
  const words = texts.value.operator;
  const [name, setName] = useState(operator.name.value);
  const [room, setRoom] = useState(operator.room.value);
  const isNew = name.trim() !== operator.name.value || room.trim() !== operator.room.value;
  const submit = (event: Event) => {
    event.preventDefault();
    operator.set(name, room);
  };
  return (
    <form class="operator-form" onSubmit={submit}>
      <label>
        <span>{words.name}</span>
        <input
          type="text"
          value={name}
          maxLength={kNameMax}
          autocomplete="off"
          onInput={(event) => setName(event.currentTarget.value)}
        />
      </label>
      <label>
        <span>{words.room}</span>
        <input
          type="text"
          value={room}
          maxLength={kNameMax}
          autocomplete="off"
          onInput={(event) => setRoom(event.currentTarget.value)}
        />
      </label>
      <button type="submit" disabled={!isNew}>
        {words.save}
      </button>
    </form>
  );
}
