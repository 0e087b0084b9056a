"""What the steps of a conversation mean to the program under test, and which can be played."""

from layout import KINDS, Pattern, number
from subject import CannotPlay

BUDGET_LEAST_US = 20_000  # A shorter budget may be over before a busy machine has read the frame.

# The steps that this tool knows, by their key (none: any value); and what else may stand in a step.
KNOWN = {
    'frame': ('client to server', 'server to client', 'network to client', 'network to server'),
    'client_does': ('open', 'call', 'take', 'cancel', 'wait', 'close', 'bind', 'call_object'),
    'client_sees': ('ready', 'refused', 'timeout', 'result', 'lost', 'item', 'closed', 'too_large',
                    'broken', 'wrong_band', 'window_full', 'not_run', 'may_have_run', 'bound',
                    'not_bound'),
    'client_counts': None,
    'server_does': ('receipt', 'item', 'complete', 'wait', 'stop', 'restart'),
    'server_sees': ('run', 'cancelled', 'no_credit', 'item_too_large', 'hang_up'),
    'server_counts': None,
    'network_does': ('disconnect',),
}
KNOWN_KEYS = set('at_ns arrives_ns note hex is_lost address priority deadline_ns service method '
                 'payload trace_id delivery window status call_id epoch path interface fingerprint '
                 'methods is_idempotent'.split())

LEVEL_2_SECTIONS = ('hp-5.6-', 'hp-5.8-', 'hp-5.9-', 'hp-5.10-')
OTHER = {'client': 'server', 'server': 'client'}


def bands_of(setup):
    """Those of a server's lanes."""
    return setup['bands'] if 'bands' in setup else [setup['band']]


def level_of(conversation):
    """README.md of the specification, 'Levels of conformance'."""
    if any(rule.startswith(LEVEL_2_SECTIONS) for rule in conversation['rules']):
        return 2
    return 0 if conversation['medium'] == 'stream' else 1


def judge(step, role):
    """What a step is to the program under test: input, output or nothing."""
    if 'frame' in step:
        way = step['frame']
        if way == f'{role} to {OTHER[role]}':
            return 'output'
        if way == f'network to {role}':
            return 'input'
        is_input = way == f'{OTHER[role]} to {role}' and not step.get('is_lost')
        return 'input' if is_input else 'nothing'
    if f'{role}_sees' in step or f'{role}_counts' in step:
        return 'output'
    return 'input' if f'{role}_does' in step or 'network_does' in step else 'nothing'


def steps_of_session(steps):
    """The steps in which the session's own service runs and completes a call."""
    found, running = set(), {}
    for i, step in enumerate(steps):
        if step.get('server_sees') == 'run':
            running[step['call_id']] = step['service'] == 0
        if running.get(step.get('call_id')) and (step.get('server_sees') == 'run' or
                                                 step.get('server_does') == 'complete'):
            found.add(i)
    return found


def tell_step(step):
    if 'frame' in step:
        return step.get('note', 'a frame')
    for name in ('client_sees', 'server_sees', 'client_counts', 'server_counts'):
        if name in step:
            rest = ' '.join(f'{key}={value}' for key, value in step.items()
                            if key not in (name, 'at_ns'))
            return f'{name.replace("_", " ")} {step[name]} {rest}'.strip()
    return str(step)


def check_playable(conversation, role, options):
    """Raises CannotPlay with the reason for what sockets or a real clock can't do."""
    steps = conversation['steps']
    wait_s = (steps[-1]['at_ns'] - steps[0]['at_ns']) / 1e9
    if wait_s > options.wait_max:
        raise CannotPlay(f'takes {wait_s:.0f} s: --wait-max {wait_s:.0f} plays it')
    for step in steps:
        check_known(step)
        kind = judge(step, role)
        if kind == 'input' and step.get('hex', '')[6:8] == f'{KINDS["CALL"]:02x}':
            check_budget(conversation, step)


def check_known(step):
    """Raises CannotPlay for a step that this tool was not made for."""
    words = [f'{key} {step[key]}' for key in step
             if KNOWN.get(key) and step[key] not in KNOWN[key]]
    keys = set(step) - set(KNOWN) - KNOWN_KEYS
    if words or keys or not any(key in step for key in KNOWN):
        raise CannotPlay('this tool does not know the step '
                         f'`{", ".join(words + sorted(keys)) or step}`: '
                         'spec/conform/steps.py has those that it knows')


def check_budget(conversation, step):
    frame = Pattern(step['hex'], conversation['free']).fill({})
    budget_us = number(frame[40:44])
    if 0 < budget_us < BUDGET_LEAST_US:
        raise CannotPlay(f'a call has a budget of {budget_us / 1000:g} ms, which may be over '
                         'before it is read from a socket')
