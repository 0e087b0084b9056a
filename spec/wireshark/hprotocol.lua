-- A dissector of the H-Protocol, version 1, for Wireshark and tshark 4.0.
-- It follows hprotocol.md; README.md says how to install and use it.
--
-- The page's tables stand here as tables. What a later version adds is mostly an entry:
--   a kind of frame    KINDS        a status       STATUSES
--   a header's field   HEADER       a payload      a layout like HELLO, named in KINDS or SESSION_METHODS
--   a check            CHECKS

local rtpm = Proto("rtpm", "H-Protocol (RTPM)")
rtpm.prefs.key_log = Pref.string("Key log file", "", "Opens sealed frames of the sessions in this file " ..
                                 "(security.md, section 9)")

-- The file beside this one.
local FOLDER = debug.getinfo(1, "S").source:match("^@?(.*[/\\])") or ""
local ciphers = dofile(FOLDER .. "hprotocol_ciphers.lua")

local HEADER_SIZE = 64
local VERSION = 1
local DEFAULT_PORT = 7420
local PRIORITY_MAX = 32767
local MESSAGE_SIZE_FLOOR, MESSAGE_SIZE_CEILING = 1024, 16 * 1024 * 1024
local DATAGRAM_PAYLOAD_MAX = 1344
local FLAG_REPEATED, FLAG_ACK_WANTED, FLAG_NO_REPLY, FLAG_REPLY_ON_RECEIPT = 1, 2, 4, 8
local FLAG_SEALED = 16
local TRAILER_SIZE, TAG_SIZE = 24, 16  -- The counter and the tag behind the payload of a sealed frame.
local FEATURES_KNOWN = 3
local FRAGMENT_COUNT_MAX = 12544

local STATUSES = {
  [0] = "ok", "overload", "expired", "no_such_method", "no_such_object", "bad_request",
  "not_lease_holder", "gone", "servant_failed", "too_large", "priority_not_allowed", "wrong_band",
  "unknown_session", "version_unsupported", "bad_limits", "wrong_interface", "cancelled", "stopping",
  "lost", "not_allowed",
}
local STATUS_OK, STATUS_EXPIRED, STATUS_WRONG_INTERFACE = 0, 2, 15

-- ---- layouts -------------------------------------------------------------------------------------
-- Each entry: offset, size, name in filters, text, and how it is shown: "dec", "hex", "bytes", a
-- table of names, or "reserved", which has to be zero. A payload may have a `check` of its own.

local function is_power_of_two(number)
  while number > 1 and number % 2 == 0 do number = number / 2 end
  return number == 1
end

local KIND_NAMES = {}  -- Filled from KINDS below.

local HEADER = {
  {0, 2, "magic", "Magic", "hex"},
  {2, 1, "version", "Version", "dec"},
  {3, 1, "kind", "Kind", KIND_NAMES},
  {4, 2, "priority", "Priority", "dec"},
  {6, 2, "flags", "Flags", "hex"},
  {8, 8, "session", "Session", "hex"},
  {16, 4, "call_id", "Call or handshake", "dec"},
  {20, 4, "service", "Service", "dec"},
  {24, 2, "method", "Method", "dec"},
  {26, 2, "status", "Status", STATUSES},
  {28, 4, "payload_size", "Payload size", "dec"},
  {32, 2, "fragment_index", "Fragment index", "dec"},
  {34, 2, "fragment_count", "Fragment count", "dec"},
  {36, 4, "message_size", "Message size", "dec"},
  {40, 4, "budget_us", "Time budget (µs)", "dec"},
  {44, 4, "item", "Item or frame of a stream", "dec"},
  {48, 8, "sender_time_ns", "Sender's time (ns)", "dec"},
  {56, 8, "trace_id", "Trace", "hex"},
}

local HELLO = {
  name = "hello", size = 64,
  {0, 2, "version_min", "Lowest version", "dec"},
  {2, 2, "version_max", "Highest version", "dec"},
  {4, 4, "features", "Features", "hex"},
  {8, 8, "client_epoch", "Client's epoch", "hex", "not zero"},
  {16, 8, "channel", "Channel", "hex"},
  {24, 8, "clock_domain", "Clock domain", "hex"},
  {32, 4, "message_size_max", "Largest message", "dec"},
  {36, 4, "reserved", "Reserved", "reserved"},
  {40, 16, "cookie", "Cookie", "bytes"},
  {56, 8, "reserved", "Reserved", "reserved"},
}

local COOKIE = {
  name = "cookie", size = 16,
  {0, 16, "cookie", "Cookie", "bytes"},
}

-- Of sealed sessions (security.md): what stands behind the ordinary payload, or instead of it.
local SEALED_HELLO = {
  name = "sealed_hello", size = 168,
  {64, 32, "ephemeral", "Client's ephemeral key", "bytes"},
  {96, 48, "static", "Client's key, encrypted", "bytes"},
  {144, 24, "payload", "Former session, encrypted", "bytes"},
}

local SEALED_COOKIE = {
  name = "sealed_cookie", size = 56,
  {16, 32, "server_key", "Server's key", "bytes"},
  {48, 4, "suites", "Suites", "hex"},
  {52, 4, "reserved", "Reserved", "reserved"},
}

local SEALED_WELCOME = {
  name = "sealed_welcome", size = 112,
  {0, 32, "ephemeral", "Server's ephemeral key", "bytes"},
  {32, 80, "payload", "Session and limits, encrypted", "bytes"},
}

local WELCOME = {
  name = "welcome", size = 48,
  {0, 2, "version", "Version", "dec"},
  {2, 2, "band_low", "Band from", "dec"},
  {4, 2, "band_high", "Band to", "dec"},
  {6, 2, "ceiling", "Ceiling", "dec"},
  {8, 4, "features", "Features", "hex"},
  {12, 2, "window", "Window", "dec", "not zero"},
  {14, 2, "reserved", "Reserved", "reserved"},
  {16, 8, "server_epoch", "Server's epoch", "hex", "not zero"},
  {24, 8, "clock_domain", "Clock domain", "hex"},
  {32, 4, "message_size_max", "Largest message", "dec"},
  {36, 12, "reserved", "Reserved", "reserved"},
  check = function(tvb, frame)
    local low, high = tvb(2, 2):le_uint(), tvb(4, 2):le_uint()
    local limit, window = tvb(32, 4):le_uint(), tvb(12, 2):le_uint()
    return tvb(0, 2):le_uint() == VERSION and is_power_of_two(window) and tvb(8, 4):le_uint() == 0 and
           limit >= MESSAGE_SIZE_FLOOR and limit <= MESSAGE_SIZE_CEILING and low <= high and high <= PRIORITY_MAX and
           tvb(6, 2):le_uint() <= PRIORITY_MAX and not frame.is_without_session
  end,
}

local BIND_REPLY = {
  name = "bind", size = 24,
  {0, 4, "service", "Service given", "dec", "not zero"},
  {4, 2, "priority", "Object's priority", "dec"},
  {6, 1, "flags", "Flags", "hex"},
  {7, 1, "reserved", "Reserved", "reserved"},
  {8, 8, "fingerprint", "Fingerprint", "hex"},
  {16, 2, "method_count", "Methods", "dec"},
  {18, 6, "reserved", "Reserved", "reserved"},
}

local ACK = {
  name = "ack", size = 40,
  {0, 2, "first_missing", "First missing fragment", "dec"},
  {2, 6, "reserved", "Reserved", "reserved"},
  {8, 32, "later", "Later ones that are there", "bytes"},
}

local CREDIT = {
  name = "credit", size = 16,
  {0, 4, "first_missing", "First missing frame", "dec"},
  {4, 4, "byte_limit", "Bytes that may come in all", "dec"},
  {8, 8, "later", "Later ones that are there", "hex"},
}

local BIND_METHOD = {
  name = "bind.method", size = 8,
  {0, 2, "id", "Method", "dec"},
  {2, 2, "reserved", "Reserved", "reserved"},
  {4, 4, "fingerprint", "Fingerprint", "hex"},
}

local fields = {}  -- By name: "rtpm.kind". Declared below, once all tables are there.

local experts = {
  malformed = ProtoExpert.new("rtpm.expert.malformed", "Malformed: a receiver drops this frame",
                              expert.group.MALFORMED, expert.severity.ERROR),
  repeated = ProtoExpert.new("rtpm.expert.repeated", "A copy of a frame sent before",
                             expert.group.SEQUENCE, expert.severity.NOTE),
  expired = ProtoExpert.new("rtpm.expert.expired", "Expired: the time budget was over",
                            expert.group.RESPONSE_CODE, expert.severity.WARN),
  gap = ProtoExpert.new("rtpm.expert.gap", "Something before this is missing",
                        expert.group.SEQUENCE, expert.severity.NOTE),
  cancelled = ProtoExpert.new("rtpm.expert.cancelled", "Cancelled: nobody waits for the call any more",
                              expert.group.SEQUENCE, expert.severity.NOTE),
  status = ProtoExpert.new("rtpm.expert.status", "The call or handshake did not end with ok",
                           expert.group.RESPONSE_CODE, expert.severity.WARN),
}
rtpm.experts = {experts.malformed, experts.repeated, experts.expired, experts.gap, experts.cancelled,
                experts.status}

-- ---- reading -------------------------------------------------------------------------------------

local function is_zero(range)
  return not range:bytes():tohex():find("[^0]")
end

-- A number of at most four bytes.
local function number(tvb, offset, size)
  return tvb(offset, size):le_uint()
end

-- Adds the fields of a layout to a tree.
local function add_layout(tree, tvb, prefix, layout)
  for _, entry in ipairs(layout) do
    local offset, size, short, _, shown = table.unpack(entry)
    local field, range = fields[prefix .. "." .. short], tvb(offset, size)
    if shown == "bytes" then
      tree:add(field, range)
    elseif shown ~= "reserved" then
      tree:add_le(field, range)
    elseif not is_zero(range) then
      tree:add(field, range)
    end
  end
end

-- Whether the payload has the layout's size, zeros where they have to be and none where not.
local function fits_layout(tvb, layout, may_be_longer)
  if tvb:len() < layout.size or (tvb:len() > layout.size and not may_be_longer) then
    return false
  end
  for _, entry in ipairs(layout) do
    local offset, size, _, _, shown, rule = table.unpack(entry)
    local zero = is_zero(tvb(offset, size))
    if (shown == "reserved" and not zero) or (rule == "not zero" and zero) then return false end
  end
  return true
end

-- A u16 length and that many bytes; nothing, if they are not there. Gives the range of the text and
-- what follows it.
local function text_at(tvb, offset)
  if offset + 2 > tvb:len() then return nil end
  local size = number(tvb, offset, 2)
  if offset + 2 + size > tvb:len() then return nil end
  return size > 0 and tvb(offset + 2, size):string() or "", offset + 2 + size, offset, 2 + size
end

local function has_flag(flags, flag)
  return flags % (2 * flag) >= flag
end

-- Rule sec-4-1: no frame of a handshake is sealed.
local function is_sealed(tvb)
  return tvb:len() >= HEADER_SIZE and has_flag(number(tvb, 6, 2), FLAG_SEALED)
end

-- Rules hp-2-2, hp-2-5 and sec-4-1.
local HAVE_ITEM = {CALL = true, REPLY = true, ACK = true, ITEM = true, CREDIT = true}
local function has_good_flags(kind, flags, item)
  if has_flag(flags, FLAG_SEALED) and kind > 3 then flags = flags - FLAG_SEALED end
  if flags >= 2 * FLAG_REPLY_ON_RECEIPT then return false end
  local is_sent, is_received = has_flag(flags, FLAG_NO_REPLY), has_flag(flags, FLAG_REPLY_ON_RECEIPT)
  if is_sent or is_received then
    return KIND_NAMES[kind] == "CALL" and item == 0 and not (is_sent and is_received)
  end
  return item == 0 or HAVE_ITEM[KIND_NAMES[kind]] == true
end

-- Rules hp-2-4, hp-5.6-1 and hp-5.8-2.
local IN_FRAGMENTS = {CALL = true, REPLY = true, ITEM = true}
local function has_good_fragment_numbers(kind, flags, payload_size, index, count, message_size)
  if count == 1 then return index == 0 and message_size == payload_size end
  local is_divisible = IN_FRAGMENTS[KIND_NAMES[kind]] == true and
                       not has_flag(flags, FLAG_NO_REPLY)
  if not is_divisible or count < 2 or count > FRAGMENT_COUNT_MAX or index >= count or
     payload_size == 0 or payload_size >= message_size or message_size > MESSAGE_SIZE_CEILING then
    return false
  end
  local size = payload_size
  if index == count - 1 then size = (message_size - payload_size) / (count - 1) end
  return size == math.floor(size) and size * count >= message_size and
         size * (count - 1) < message_size
end

-- The checks of a header in the order of rule hp-2-1; the first that finds something says why a
-- receiver drops the frame.
local CHECKS = {
  {"too_short", function(tvb) return tvb:reported_len() < HEADER_SIZE end},
  {"bad_magic", function(tvb) return tvb(0, 2):string() ~= "HP" end},
  {"bad_version", function(tvb) return number(tvb, 2, 1) ~= VERSION end},
  {"bad_kind", function(tvb) return KIND_NAMES[number(tvb, 3, 1)] == nil end},
  {"bad_priority", function(tvb) return number(tvb, 4, 2) > PRIORITY_MAX end},
  {"reserved_set", function(tvb)
    return not has_good_flags(number(tvb, 3, 1), number(tvb, 6, 2), number(tvb, 44, 4))
  end},
  {"bad_length", function(tvb) return number(tvb, 28, 4) > MESSAGE_SIZE_CEILING end},
  {"bad_fragment", function(tvb)
    return not has_good_fragment_numbers(number(tvb, 3, 1), number(tvb, 6, 2), number(tvb, 28, 4),
                                         number(tvb, 32, 2), number(tvb, 34, 2),
                                         number(tvb, 36, 4))
  end},
}

local function header_fault(tvb)
  for _, check in ipairs(CHECKS) do
    if check[2](tvb) then return check[1] end
  end
  return nil
end

-- The size of the frame that a stream goes on with. Behind a bad header nobody knows: the rest then
-- belongs to it.
local function frame_size(tvb, _, offset)
  local rest = tvb(offset):tvb()
  if header_fault(rest) then return rest:len() end
  return HEADER_SIZE + number(rest, 28, 4) + (is_sealed(rest) and TRAILER_SIZE or 0)
end

-- ---- what belongs together -----------------------------------------------------------------------

local exchanges  -- By key: the frames of one call, or of one step of a handshake.
local handshakes -- By key: the exchange that a handshake is at.
local known      -- By frame: its exchange, and which frame of it this one is.
local objects    -- By server and service: the path of the object that was bound last.
local paths      -- By frame: the path of its object, as it was then.
local wholes     -- By frame that completes a message in fragments: the whole of it.
local servers    -- By endpoint: whether a client was seen to talk to it.

local read_key_log

function rtpm.init()
  read_key_log()
  exchanges, handshakes, known, objects, paths, servers, wholes = {}, {}, {}, {}, {}, {}, {}
end

-- ---- the key log ---------------------------------------------------------------------------------

local logged       -- By session: its suite, and the keys of each direction by generation.
local logged_size  -- Of the file when it was read.
local GENERATION_MAX = 10000  -- Each costs a tenth of a millisecond, once.

local function bytes_of(hex)
  return (hex:gsub("..", function(pair) return string.char(tonumber(pair, 16)) end))
end

-- Reads the file if it has grown: programs append a line for each session.
function read_key_log()
  logged = logged or {}
  local file = rtpm.prefs.key_log ~= "" and io.open(rtpm.prefs.key_log, "r")
  if not file then return end
  local size = file:seek("end")
  if size ~= logged_size then
    logged, logged_size = {}, size
    file:seek("set")
    for line in file:lines() do
      local session, suite, client, server = line:match(
        "^RTPM_SESSION (%x+) (%S+) (%x+) (%x+)%s*$")
      if session and #session == 16 and ciphers.is_suite(suite) and #client == 64 and
         #server == 64 then
        logged["0x" .. session:lower()] = {
          suite = suite, client = {[0] = ciphers.key(bytes_of(client))},
          server = {[0] = ciphers.key(bytes_of(server))},
        }
      end
    end
  end
  file:close()
end

-- The key of one direction and generation.
local function key_of(entry, side, generation)
  local keys = entry[side]
  if generation > GENERATION_MAX then return nil end
  for i = #keys + 1, generation do keys[i] = ciphers.next_key(entry.suite, keys[i - 1]) end
  return keys[generation]
end

-- The counter of a sealed frame, and what it says of the key.
local function counter_of(tvb)
  local at = tvb:len() - TRAILER_SIZE
  local low, high = number(tvb, at, 4), number(tvb, at + 4, 4)
  return tvb(at, 8), high * 1024 + math.floor(low / 4194304)
end

-- The payload of a sealed frame in the clear; nothing without its key.
local function open_payload(frame, text)
  local entry = logged[frame.session]
  if not entry then
    if not frame.pinfo.visited then read_key_log() end
    entry = logged[frame.session]
  end
  if not entry then return nil end
  local counter, generation = counter_of(frame.tvb)
  local key = key_of(entry, frame.is_from_client and "client" or "server", generation)
  return key and ciphers.decrypt(entry.suite, key, counter:raw(), text)
end

local function endpoint(address, port)
  return tostring(address) .. ":" .. tostring(port)
end

-- What tells a frame: a segment of a stream may have several.
local function identity(frame)
  return table.concat({frame.pinfo.number, frame.kind, frame.session, frame.call_id, frame.flags,
                       frame.status, frame.fragment_index, frame.item}, "/")
end

local function exchange_of(key, frame)
  local exchange = exchanges[key]
  if not exchange then
    exchange = {first = frame.pinfo.number, first_time = frame.pinfo.rel_ts}
    exchanges[key] = exchange
  end
  return exchange
end

local function call_key(frame)
  return frame.server .. "/" .. frame.session .. "/" .. frame.call_id
end

local function handshake_key(frame)
  return frame.client .. "/" .. frame.server .. "/" .. frame.call_id
end

-- Takes note of a request when it is seen first; gives its exchange.
local function note_request(key, frame)
  local exchange = exchange_of(key, frame)
  known[identity(frame)] = {exchange = exchange, is_copy = exchange.first ~= frame.pinfo.number}
  return exchange
end

local function note_answer(exchange, frame)
  if not exchange then return end
  local outcome = frame.kind .. "/" .. frame.status
  if not exchange.reply then exchange.reply, exchange.outcome = frame.pinfo.number, outcome end
  known[identity(frame)] = {
    exchange = exchange,
    is_copy = exchange.reply ~= frame.pinfo.number and exchange.outcome == outcome,
    time = frame.pinfo.rel_ts - exchange.first_time,
  }
end

-- A HELLO with another cookie is the next step of its handshake.
local function note_hello(frame)
  local is_there = frame.payload:len() >= HELLO.size
  local cookie = is_there and frame.payload(40, 16):bytes():tohex() or frame.pinfo.number
  handshakes[handshake_key(frame)] = note_request(handshake_key(frame) .. "/" .. cookie, frame)
end

local function note_handshake_answer(frame)
  note_answer(handshakes[handshake_key(frame)], frame)
end

-- Puts the fragments of a message together. Gives whether this one was there already. Each item of a
-- stream is a message of its own: the number of its first frame tells which (hp-5.10-1).
local function note_fragment(exchange, frame)
  if frame.fragment_count == 1 then return false end
  exchange.messages = exchange.messages or {}
  local key = frame.kind
  if frame.kind_name == "ITEM" then key = "item " .. frame.item - frame.fragment_index end
  local message = exchange.messages[key]
  if not message or message.count ~= frame.fragment_count then
    message = {count = frame.fragment_count, parts = {}, missing = frame.fragment_count, highest = -1}
    exchange.messages[key] = message
  end
  local mine = known[identity(frame)]
  mine.message, mine.has_gap = message, frame.fragment_index > message.highest + 1
  message.highest = math.max(message.highest, frame.fragment_index)
  if message.parts[frame.fragment_index] then return true end
  if frame.is_closed then return false end
  message.parts[frame.fragment_index] = frame.payload:bytes()
  message.missing = message.missing - 1
  if message.missing > 0 then return false end
  local whole = ByteArray.new()
  for i = 0, message.count - 1 do
    whole:append(message.parts[i])
  end
  message.whole_in, wholes[identity(frame)] = frame.pinfo.number, whole
  return false
end

local function note_call(frame)
  local exchange = note_request(call_key(frame), frame)
  exchange.service, exchange.method = frame.service, frame.method
  if frame.fragment_count > 1 then
    known[identity(frame)].is_copy = note_fragment(exchange, frame)
  end
  if frame.service == 0 and frame.method == 1 and frame.fragment_index == 0 and
     not frame.is_closed then
    exchange.path = exchange.path or text_at(frame.payload, 8)
  end
end

-- Another frame of a call that was seen; gives what is known of it.
local function note_of_call(frame)
  local exchange = exchanges[call_key(frame)]
  if not exchange or exchange.service ~= frame.service or exchange.method ~= frame.method then
    return nil  -- Rule hp-5.1-3.
  end
  local mine = {exchange = exchange, is_of_call = true}
  known[identity(frame)] = mine
  return mine, exchange
end

local function note_item(frame)
  local mine, exchange = note_of_call(frame)
  if not mine then return end
  exchange.items = exchange.items or {}
  mine.is_copy = exchange.items[frame.item] ~= nil
  mine.first_of_copy = exchange.items[frame.item]
  note_fragment(exchange, frame)
  mine.has_gap = frame.item > (exchange.item_next or 0)
  exchange.items[frame.item] = exchange.items[frame.item] or frame.pinfo.number
  exchange.item_next = math.max(exchange.item_next or 0, frame.item + 1)
  mine.time = frame.pinfo.rel_ts - exchange.first_time
end

local function note_reply(frame)
  local mine, exchange = note_of_call(frame)
  if not mine then return end
  note_answer(exchange, frame)
  if frame.fragment_count > 1 then
    known[identity(frame)].is_copy = note_fragment(exchange, frame)
    return
  end
  if exchange.path and frame.status == STATUS_OK and not frame.is_closed and
     frame.payload:len() >= 4 then
    objects[frame.server .. "/" .. number(frame.payload, 0, 4)] = exchange.path
  end
end

-- A REFUSE answers a call, or a HELLO, whose session is 0.
local function note_refuse(frame)
  local exchange = exchanges[call_key(frame)]
  if exchange then
    note_answer(exchange, frame)
  elseif frame.is_without_session then
    note_handshake_answer(frame)
  end
end

local function add_time(tree, time)
  local seconds = math.floor(time)
  local nanoseconds = math.floor((time - seconds) * 1e9 + 0.5)
  if nanoseconds >= 1000000000 then seconds, nanoseconds = seconds + 1, 0 end
  tree:add(fields["rtpm.time"], NSTime.new(seconds, nanoseconds)):set_generated()
end

local function add_links(tree, frame)
  local mine = known[identity(frame)]
  if mine then
    local exchange = mine.exchange
    if mine.is_of_call then
      tree:add(fields["rtpm.call_in"], exchange.first):set_generated()
      if mine.is_copy then
        tree:add(fields["rtpm.copy_of"], mine.first_of_copy):set_generated()
      end
      if mine.time then add_time(tree, mine.time) end
    elseif frame.kind_entry.from == "client" then
      if mine.is_copy then tree:add(fields["rtpm.copy_of"], exchange.first):set_generated() end
      if exchange.reply then
        tree:add(fields["rtpm.reply_in"], exchange.reply):set_generated()
      end
    else
      tree:add(fields["rtpm.request_in"], exchange.first):set_generated()
      if mine.is_copy then tree:add(fields["rtpm.copy_of"], exchange.reply):set_generated() end
      add_time(tree, mine.time)
    end
    local message = mine.message
    if message and message.whole_in then
      tree:add(fields["rtpm.whole_in"], message.whole_in):set_generated()
    end
    if mine.has_gap then tree:add_proto_expert_info(experts.gap) end
  end
  if frame.kind_name == "REPLY" then
    tree:add(fields["rtpm.server_us"], frame.tvb(40, 4), frame.budget_us):set_generated()
  end
  if frame.is_repeated or (mine and mine.is_copy) then
    tree:add_proto_expert_info(experts.repeated)
  end
end

-- ---- payloads ------------------------------------------------------------------------------------
-- Each function adds a payload to a tree and gives whether a receiver can read it.

-- What a schema describes is not known here.
local function opaque(tree, tvb)
  if tvb:len() > 0 then tree:add(fields["rtpm.payload"], tvb()) end
  return true
end

-- What must have none.
local function none(tree, tvb)
  opaque(tree, tvb)
  return tvb:len() == 0
end

local function layout_payload(layout)
  return function(tree, tvb, frame)
    if tvb:len() < layout.size then return false end
    add_layout(tree, tvb, "rtpm." .. layout.name, layout)
    return fits_layout(tvb, layout) and (not layout.check or layout.check(tvb, frame))
  end
end

-- The payload of a handshake's frame, which has another size in a sealed one.
local function handshake_payload(layout, sealed, has_layout)
  local plain = layout_payload(layout)
  return function(tree, tvb, frame)
    if tvb:len() ~= sealed.size then
      return plain(tree, tvb, frame)
    end
    if has_layout then add_layout(tree, tvb, "rtpm." .. layout.name, layout) end
    add_layout(tree, tvb, "rtpm." .. sealed.name, sealed)
    return fits_layout(tvb, sealed) and (not has_layout or fits_layout(tvb, layout, true)) and
           (not sealed.check or sealed.check(tvb))
  end
end

-- Rule sec-3.2-1.
function SEALED_HELLO.check(tvb)
  local features = number(tvb, 4, 4)
  return features <= FEATURES_KNOWN and has_flag(features, 1)
end

local function add_text(tree, name, tvb, offset)
  local text, next_offset, at, size = text_at(tvb, offset)
  if text then tree:add(fields[name], tvb(at, size), text) end
  return next_offset
end

local function bind_request(tree, tvb)
  if tvb:len() < 8 then return false end
  tree:add_le(fields["rtpm.bind.fingerprint"], tvb(0, 8))
  local offset = add_text(tree, "rtpm.bind.path", tvb, 8)
  offset = offset and add_text(tree, "rtpm.bind.interface", tvb, offset)
  return offset == tvb:len()
end

local function bind_reply(tree, tvb, frame)
  if frame.status == STATUS_WRONG_INTERFACE then
    return add_text(tree, "rtpm.bind.interface", tvb, 0) == tvb:len()
  end
  if frame.status ~= STATUS_OK then return opaque(tree, tvb) end
  if tvb:len() < BIND_REPLY.size then return false end
  add_layout(tree, tvb, "rtpm.bind", BIND_REPLY)
  tree:add_le(fields["rtpm.bind.flags.server_declared"], tvb(6, 1))
  tree:add_le(fields["rtpm.bind.flags.complete"], tvb(6, 1))
  local count = number(tvb, 16, 2)
  if tvb:len() ~= BIND_REPLY.size + count * BIND_METHOD.size then return false end
  local is_good = fits_layout(tvb, BIND_REPLY, true) and number(tvb, 6, 1) < 4
  for i = 0, count - 1 do
    local entry = tvb(BIND_REPLY.size + i * BIND_METHOD.size, BIND_METHOD.size):tvb()
    add_layout(tree, entry, "rtpm.bind.method", BIND_METHOD)
    is_good = is_good and fits_layout(entry, BIND_METHOD)
  end
  return is_good
end

-- The session's own methods.
local SESSION_METHODS = {
  [1] = {name = "bind", request = bind_request, reply = bind_reply},
}

local function call_payload(which)
  return function(tree, tvb, frame)
    local is_whole = frame.fragment_count == 1 or frame.is_reassembled
    local method = is_whole and frame.service == 0 and SESSION_METHODS[frame.method]
    return (method and method[which] or opaque)(tree, tvb, frame)
  end
end

-- ---- kinds ---------------------------------------------------------------------------------------

local function describe_object(frame)
  if frame.service == 0 then
    local method = SESSION_METHODS[frame.method]
    return method and method.name or "session method " .. frame.method
  end
  return (frame.path or "service " .. frame.service) .. " method " .. frame.method
end

local function describe_status(frame)
  return STATUSES[frame.status] or "status " .. frame.status
end

-- For each kind: its name, the side that sends it, what its payload is, whom it belongs to, and what
-- the column Info says besides the name and number.
local KINDS = {
  [1] = {name = "HELLO", from = "client", payload = handshake_payload(HELLO, SEALED_HELLO, true), note = note_hello,
         info = function(frame) return "priority " .. frame.priority end},
  [2] = {name = "COOKIE", from = "server", payload = handshake_payload(COOKIE, SEALED_COOKIE, true),
         note = note_handshake_answer},
  [3] = {name = "WELCOME", from = "server", payload = handshake_payload(WELCOME, SEALED_WELCOME, false),
         note = note_handshake_answer,
         info = function(frame) return "session " .. frame.session end},
  [4] = {name = "REFUSE", from = "server", payload = none, note = note_refuse,
         info = describe_status},
  [5] = {name = "CALL", from = "client", payload = call_payload("request"), note = note_call,
         info = function(frame)
           return describe_object(frame) .. ", priority " .. frame.priority .. ", " ..
                  frame.budget_us .. " µs left"
         end},
  [6] = {name = "REPLY", from = "server", payload = call_payload("reply"), note = note_reply,
         info = function(frame) return describe_object(frame) .. ": " .. describe_status(frame) end},
  [7] = {name = "CLOSE", from = "either", payload = none,
         info = function(frame) return "session " .. frame.session end},
  [8] = {name = "ACK", from = "either", payload = layout_payload(ACK), note = note_of_call,
         info = function(frame)
           local is_there = frame.payload:len() >= 2 and not frame.is_closed
           return "of call " .. frame.call_id ..
                  (is_there and ", all before fragment " .. number(frame.payload, 0, 2) or "")
         end},
  [9] = {name = "CANCEL", from = "client", payload = none, note = note_of_call,
         info = describe_object},
  [10] = {name = "ITEM", from = "server", payload = opaque, note = note_item,
          info = function(frame)
            local part = ""
            if frame.fragment_count > 1 then
              part = ", fragment " .. frame.fragment_index .. " of " .. frame.fragment_count
            end
            return describe_object(frame) .. ", item frame " .. frame.item .. part
          end},
  [11] = {name = "CREDIT", from = "client", payload = layout_payload(CREDIT), note = note_of_call,
          info = function(frame)
            local is_there = frame.payload:len() >= 4 and not frame.is_closed
            return describe_object(frame) ..
                   (is_there and ", all before frame " .. number(frame.payload, 0, 4) or "") ..
                   ", up to item " .. frame.item
          end},
}
for number_, entry in pairs(KINDS) do
  KIND_NAMES[number_] = entry.name
end

-- ---- fields --------------------------------------------------------------------------------------

local MAKERS = {[1] = ProtoField.uint8, [2] = ProtoField.uint16, [4] = ProtoField.uint32,
                [8] = ProtoField.uint64}

local function declare(name, field)
  fields[name] = field
end

-- The fields of a layout, under `prefix`; a name that stands twice is one field.
local function declare_layout(prefix, layout)
  for _, entry in ipairs(layout) do
    local _, size, short, text, shown = table.unpack(entry)
    local name = prefix .. "." .. short
    if fields[name] then
      -- Declared already.
    elseif shown == "bytes" or shown == "reserved" then
      declare(name, ProtoField.bytes(name, text))
    elseif shown == "hex" then
      declare(name, MAKERS[size](name, text, base.HEX))
    elseif type(shown) == "table" then
      declare(name, MAKERS[size](name, text, base.DEC, shown))
    else
      declare(name, MAKERS[size](name, text, base.DEC))
    end
  end
end

declare_layout("rtpm", HEADER)
for _, layout in ipairs({HELLO, COOKIE, WELCOME, SEALED_HELLO, SEALED_COOKIE, SEALED_WELCOME,
                         BIND_REPLY, BIND_METHOD, ACK, CREDIT}) do
  declare_layout("rtpm." .. layout.name, layout)
end
declare("rtpm.flags.repeated", ProtoField.bool("rtpm.flags.repeated", "Repeated", 16, nil, FLAG_REPEATED))
declare("rtpm.flags.ack_wanted",
        ProtoField.bool("rtpm.flags.ack_wanted", "ACK wanted", 16, nil, FLAG_ACK_WANTED))
declare("rtpm.flags.no_reply",
        ProtoField.bool("rtpm.flags.no_reply", "No reply", 16, nil, FLAG_NO_REPLY))
declare("rtpm.flags.reply_on_receipt",
        ProtoField.bool("rtpm.flags.reply_on_receipt", "Reply on receipt", 16, nil,
                        FLAG_REPLY_ON_RECEIPT))
declare("rtpm.flags.sealed", ProtoField.bool("rtpm.flags.sealed", "Sealed", 16, nil, FLAG_SEALED))
declare("rtpm.sealed.encrypted", ProtoField.bytes("rtpm.sealed.encrypted", "Encrypted payload"))
declare("rtpm.sealed.counter", ProtoField.uint64("rtpm.sealed.counter", "Counter", base.DEC))
declare("rtpm.sealed.generation", ProtoField.uint32("rtpm.sealed.generation", "Generation of the key",
                                                    base.DEC))
declare("rtpm.sealed.tag", ProtoField.bytes("rtpm.sealed.tag", "Tag (not checked)"))
declare("rtpm.bind.flags.server_declared",
        ProtoField.bool("rtpm.bind.flags.server_declared", "Server-declared", 8, nil, 1))
declare("rtpm.bind.flags.complete",
        ProtoField.bool("rtpm.bind.flags.complete", "List of methods is complete", 8, nil, 2))
declare("rtpm.bind.path", ProtoField.string("rtpm.bind.path", "Path"))
declare("rtpm.bind.interface", ProtoField.string("rtpm.bind.interface", "Interface"))
declare("rtpm.payload", ProtoField.bytes("rtpm.payload", "Payload"))
-- What the dissector concludes; Wireshark shows these in brackets.
declare("rtpm.drop", ProtoField.string("rtpm.drop", "A receiver drops this as"))
declare("rtpm.object", ProtoField.string("rtpm.object", "Object"))
declare("rtpm.request_in", ProtoField.framenum("rtpm.request_in", "Answer to the frame", base.NONE,
                                              frametype.REQUEST))
declare("rtpm.call_in", ProtoField.framenum("rtpm.call_in", "Of the call in the frame", base.NONE,
                                           frametype.REQUEST))
declare("rtpm.whole_in", ProtoField.framenum("rtpm.whole_in", "The message is whole in the frame",
                                            base.NONE))
declare("rtpm.message", ProtoField.bytes("rtpm.message", "Whole message"))
declare("rtpm.reply_in", ProtoField.framenum("rtpm.reply_in", "Answered in the frame", base.NONE,
                                            frametype.RESPONSE))
declare("rtpm.copy_of", ProtoField.framenum("rtpm.copy_of", "Copy of the frame", base.NONE,
                                           frametype.RETRANS_PREV))
declare("rtpm.time", ProtoField.relative_time("rtpm.time", "Time since the first request"))
declare("rtpm.server_us", ProtoField.uint32("rtpm.server_us", "Of it at the server (µs)", base.DEC))

local all_fields = {}
for _, field in pairs(fields) do
  all_fields[#all_fields + 1] = field
end
rtpm.fields = all_fields

-- ---- dissection ----------------------------------------------------------------------------------

local function read_frame(tvb, pinfo)
  local frame = {
    tvb = tvb, pinfo = pinfo, kind = number(tvb, 3, 1), priority = number(tvb, 4, 2),
    flags = number(tvb, 6, 2), session = "0x" .. tostring(tvb(8, 8):le_uint64():tohex()),
    call_id = number(tvb, 16, 4), service = number(tvb, 20, 4), method = number(tvb, 24, 2),
    status = number(tvb, 26, 2), budget_us = number(tvb, 40, 4),
    fragment_index = number(tvb, 32, 2), fragment_count = number(tvb, 34, 2),
    item = number(tvb, 44, 4),
    is_without_session = is_zero(tvb(8, 8)),
  }
  frame.is_repeated = has_flag(frame.flags, FLAG_REPEATED)
  frame.kind_entry = KINDS[frame.kind]
  frame.kind_name = frame.kind_entry.name
  frame.is_sealed = is_sealed(tvb)
  local source, destination = endpoint(pinfo.src, pinfo.src_port), endpoint(pinfo.dst, pinfo.dst_port)
  local is_from_client = frame.kind_entry.from == "client"
  -- An ACK or CLOSE comes from either side: the server is whom HELLOs and CALLs went to.
  if frame.kind_entry.from == "either" then is_from_client = not servers[source] end
  frame.client = is_from_client and source or destination
  frame.server = is_from_client and destination or source
  if frame.kind_entry.from ~= "either" then servers[frame.server] = true end
  frame.is_from_client = is_from_client
  frame.payload = tvb(HEADER_SIZE):tvb()
  return frame
end

-- Shows what a sealed frame has beside its payload, and opens that if its key is known.
local function add_seal(tree, frame)
  if not frame.is_sealed then return end
  frame.is_closed = true
  local tvb = frame.tvb
  local size = number(tvb, 28, 4)
  if tvb:len() ~= HEADER_SIZE + size + TRAILER_SIZE then return end  -- Cut, or of a wrong size.
  local counter, generation = counter_of(tvb)
  tree:add_le(fields["rtpm.sealed.counter"], counter)
  tree:add(fields["rtpm.sealed.generation"], counter, generation):set_generated()
  tree:add(fields["rtpm.sealed.tag"], tvb(tvb:len() - TAG_SIZE, TAG_SIZE))
  if size == 0 then
    frame.is_closed, frame.payload = logged[frame.session] == nil, tvb(HEADER_SIZE, 0):tvb()
    return
  end
  frame.payload = tvb(HEADER_SIZE, size):tvb()
  tree:add(fields["rtpm.sealed.encrypted"], frame.payload())
  local plain = open_payload(frame, frame.payload():raw())
  if not plain then return end
  frame.is_closed = false
  frame.payload = ByteArray.new(plain, true):tvb("Opened payload")
end

local function add_fault(tree, pinfo, reason)
  tree:add(fields["rtpm.drop"], reason):set_generated()
  tree:add_proto_expert_info(experts.malformed, "Malformed: a receiver drops this as " .. reason)
  pinfo.cols.info:append(" [" .. reason .. "]")
end

local function add_info(frame)
  local words = frame.kind_name .. " " .. frame.call_id
  if frame.is_repeated then words = words .. " (repeated)" end
  if frame.kind_entry.info then words = words .. ", " .. frame.kind_entry.info(frame) end
  frame.pinfo.cols.info:append((tostring(frame.pinfo.cols.info) == "" and "" or "; ") .. words)
end

local function add_status(tree, frame)
  if frame.status == STATUS_OK or frame.kind_entry.from ~= "server" then return end
  local which = frame.status == STATUS_EXPIRED and experts.expired or experts.status
  tree:add_proto_expert_info(which, frame.kind_name .. " with status " .. describe_status(frame))
end

-- What a frame says of loss and of the end, beside what its links tell.
local function add_notes(tree, frame)
  if frame.kind_name == "CANCEL" then tree:add_proto_expert_info(experts.cancelled) end
  if frame.is_closed then return end
  local is_progress = frame.kind_name == "ACK" or frame.kind_name == "CREDIT"
  if is_progress and frame.payload:len() >= 16 and not is_zero(frame.payload(8)) then
    tree:add_proto_expert_info(experts.gap, "Its sender lacks what lies before something later")
  end
end

-- The message that this frame completes.
local function add_whole(tree, frame)
  local whole = wholes[identity(frame)]
  if not whole then return end
  local tvb = whole:tvb("Whole message")
  local branch = tree:add(tvb(), "Message of " .. frame.fragment_count .. " fragments, " ..
                                 tvb:len() .. " bytes")
  branch:add(fields["rtpm.message"], tvb())
  frame.is_reassembled = true
  frame.kind_entry.payload(branch, tvb, frame)
end

-- A header of which no more is known than that it is wrong.
local function add_bad_header(tree, tvb, pinfo, reason)
  if tvb:len() >= HEADER_SIZE then add_layout(tree, tvb, "rtpm", HEADER) end
  pinfo.cols.info:append("no H-Protocol frame")
  add_fault(tree, pinfo, reason)
end

-- Why a receiver drops a frame whose header is good; nothing if it does not.
local function add_payload(tree, frame, is_datagram)
  local reported_size = frame.tvb:reported_len() - HEADER_SIZE
  local size_max = DATAGRAM_PAYLOAD_MAX
  if frame.is_sealed then
    reported_size, size_max = reported_size - TRAILER_SIZE, size_max - TRAILER_SIZE
  end
  local has_its_size = number(frame.tvb, 28, 4) == reported_size
  if is_datagram and (not has_its_size or reported_size > size_max) then return "bad_length" end
  if frame.kind_name == "REFUSE" and frame.status == STATUS_OK then return "unexpected" end
  if frame.is_closed then return nil end
  if frame.payload:len() > 0 then
    tree = tree:add(frame.payload(), "Payload of " .. frame.kind_name)
  end
  local is_good = frame.kind_entry.payload(tree, frame.payload, frame)
  local is_whole = frame.payload:len() == reported_size  -- A capture may have cut it.
  return is_whole and not is_good and "bad_payload" or nil
end

local function dissect_frame(tvb, pinfo, tree, is_datagram)
  local branch = tree:add(rtpm, tvb())
  if tvb:len() < HEADER_SIZE and tvb:reported_len() >= HEADER_SIZE then
    branch:append_text(", cut by the capture")
    pinfo.cols.info:append("cut by the capture")
    return tvb:len()
  end
  local reason = header_fault(tvb)
  if reason then
    add_bad_header(branch, tvb, pinfo, reason)
    return tvb:len()
  end
  add_layout(branch, tvb, "rtpm", HEADER)
  branch:add_le(fields["rtpm.flags.repeated"], tvb(6, 2))
  branch:add_le(fields["rtpm.flags.ack_wanted"], tvb(6, 2))
  branch:add_le(fields["rtpm.flags.no_reply"], tvb(6, 2))
  branch:add_le(fields["rtpm.flags.reply_on_receipt"], tvb(6, 2))
  branch:add_le(fields["rtpm.flags.sealed"], tvb(6, 2))
  local frame = read_frame(tvb, pinfo)
  add_seal(branch, frame)
  branch:append_text(", " .. frame.kind_name)
  reason = add_payload(branch, frame, is_datagram)
  if not reason and not pinfo.visited then
    if frame.kind_entry.note then frame.kind_entry.note(frame) end
    paths[identity(frame)] = objects[frame.server .. "/" .. frame.service]
  end
  frame.path = paths[identity(frame)]
  if frame.path then branch:add(fields["rtpm.object"], frame.path):set_generated() end
  add_info(frame)
  add_links(branch, frame)
  add_status(branch, frame)
  add_notes(branch, frame)
  add_whole(branch, frame)
  if reason then add_fault(branch, pinfo, reason) end
  return tvb:len()
end

local function dissect_datagram(tvb, pinfo, tree)
  return dissect_frame(tvb, pinfo, tree, true)
end

local function dissect_stream_frame(tvb, pinfo, tree)
  return dissect_frame(tvb, pinfo, tree, false)
end

local PORT_TYPE_TCP = 2

function rtpm.dissector(tvb, pinfo, tree)
  pinfo.cols.protocol = "RTPM"
  pinfo.cols.info = ""
  if pinfo.port_type ~= PORT_TYPE_TCP then return dissect_datagram(tvb, pinfo, tree) end
  dissect_tcp_pdus(tvb, tree, HEADER_SIZE, frame_size, dissect_stream_frame)
  return tvb:len()
end

-- On other ports a conversation is ours if it has a header that begins as ours do; from then on also
-- what is malformed in it.
local function dissect_if_ours(tvb, pinfo, tree)
  if tvb:len() < HEADER_SIZE then return false end
  if tvb(0, 2):string() ~= "HP" or number(tvb, 2, 1) ~= VERSION then return false end
  if KINDS[number(tvb, 3, 1)] == nil then return false end
  pinfo.conversation = rtpm
  rtpm.dissector(tvb, pinfo, tree)
  return true
end

for _, transport in ipairs({"udp", "tcp"}) do
  local ports = DissectorTable.get(transport .. ".port")
  ports:add(DEFAULT_PORT, rtpm)
  ports:add_for_decode_as(rtpm)
  rtpm:register_heuristic(transport, dissect_if_ours)
end
