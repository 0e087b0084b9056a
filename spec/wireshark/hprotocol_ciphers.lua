-- ChaCha20 (RFC 8439) and AES-256 in counter mode as in GCM, in plain Lua 5.2: what hprotocol.lua needs
-- to read sealed frames. It decrypts only. No tag is checked, so whether a frame is authentic is not
-- known, and its time depends on keys: it is for reading captures, and for nothing else.

local band, bxor, lrotate, rshift = bit32.band, bit32.bxor, bit32.lrotate, bit32.rshift
local char, byte = string.char, string.byte
local WORD = 4294967296

local function little_endian(text, at)
  local a, b, c, d = byte(text, at, at + 3)
  return a + 256 * b + 65536 * c + 16777216 * d
end

local function big_endian(text, at)
  local a, b, c, d = byte(text, at, at + 3)
  return 16777216 * a + 65536 * b + 256 * c + d
end

local function xor_texts(one, other)
  local out = {}
  for i = 1, #one do out[i] = char(bxor(byte(one, i), byte(other, i))) end
  return table.concat(out)
end

-- ---- ChaCha20 ------------------------------------------------------------------------------------

local function quarter_round(x, a, b, c, d)
  x[a] = (x[a] + x[b]) % WORD
  x[d] = lrotate(bxor(x[d], x[a]), 16)
  x[c] = (x[c] + x[d]) % WORD
  x[b] = lrotate(bxor(x[b], x[c]), 12)
  x[a] = (x[a] + x[b]) % WORD
  x[d] = lrotate(bxor(x[d], x[a]), 8)
  x[c] = (x[c] + x[d]) % WORD
  x[b] = lrotate(bxor(x[b], x[c]), 7)
end

-- 64 bytes of the key stream.
local function chacha_block(key, counter, n)
  local begin = {0x61707865, 0x3320646e, 0x79622d32, 0x6b206574}
  for i = 0, 7 do begin[5 + i] = little_endian(key, 1 + 4 * i) end
  begin[13], begin[14], begin[15], begin[16] = counter, 0, little_endian(n, 1), little_endian(n, 5)
  local x = {table.unpack(begin)}
  for _ = 1, 10 do
    quarter_round(x, 1, 5, 9, 13)
    quarter_round(x, 2, 6, 10, 14)
    quarter_round(x, 3, 7, 11, 15)
    quarter_round(x, 4, 8, 12, 16)
    quarter_round(x, 1, 6, 11, 16)
    quarter_round(x, 2, 7, 12, 13)
    quarter_round(x, 3, 8, 9, 14)
    quarter_round(x, 4, 5, 10, 15)
  end
  local out = {}
  for i = 1, 16 do
    local word = (x[i] + begin[i]) % WORD
    out[i] = char(band(word, 255), band(rshift(word, 8), 255), band(rshift(word, 16), 255),
                  rshift(word, 24))
  end
  return table.concat(out)
end

-- ---- AES-256 -------------------------------------------------------------------------------------

local SBOX, T0, T1, T2, T3 = {}, {}, {}, {}, {}

local function double(value)
  return value < 128 and 2 * value or bxor(2 * value, 0x11b)
end

local function make_tables()
  -- 3 generates the field; its powers give the inverses.
  local power, log, value = {}, {}, 1
  for i = 0, 254 do
    power[i], log[value] = value, i
    value = bxor(value, double(value))
  end
  for i = 0, 255 do
    local inverse = i == 0 and 0 or power[(255 - log[i]) % 255]
    local s = inverse
    for shift = 1, 4 do
      s = bxor(s, band(inverse * 2 ^ shift, 255), rshift(inverse, 8 - shift))
    end
    s = bxor(s, 0x63)
    local twice = double(s)
    SBOX[i] = s
    T0[i] = 16777216 * twice + 65536 * s + 256 * s + bxor(twice, s)
    T1[i], T2[i], T3[i] = lrotate(T0[i], 24), lrotate(T0[i], 16), lrotate(T0[i], 8)
  end
end
make_tables()

local function substitute(word)
  return 16777216 * SBOX[rshift(word, 24)] + 65536 * SBOX[band(rshift(word, 16), 255)] +
         256 * SBOX[band(rshift(word, 8), 255)] + SBOX[band(word, 255)]
end

local expanded = setmetatable({}, {__mode = "k"})  -- By key, which its owner keeps.

local function round_keys(key)
  if expanded[key] then return expanded[key] end
  local words, constant = {}, 1
  for i = 0, 7 do words[i] = big_endian(key.bytes, 1 + 4 * i) end
  for i = 8, 59 do
    local word = words[i - 1]
    if i % 8 == 0 then
      word = bxor(substitute(lrotate(word, 8)), 16777216 * constant)
      constant = double(constant)
    elseif i % 8 == 4 then
      word = substitute(word)
    end
    words[i] = bxor(words[i - 8], word)
  end
  expanded[key] = words
  return words
end

local function aes_column(a, b, c, d, round_key)
  return bxor(T0[rshift(a, 24)], T1[band(rshift(b, 16), 255)], T2[band(rshift(c, 8), 255)],
              T3[band(d, 255)], round_key)
end

local function last_column(a, b, c, d, round_key)
  return bxor(16777216 * SBOX[rshift(a, 24)] + 65536 * SBOX[band(rshift(b, 16), 255)] +
              256 * SBOX[band(rshift(c, 8), 255)] + SBOX[band(d, 255)], round_key)
end

local function word_text(word)
  return char(rshift(word, 24), band(rshift(word, 16), 255), band(rshift(word, 8), 255),
              band(word, 255))
end

-- 16 bytes of the key stream; n in its 8 bytes, little-endian.
local function aes_block(keys, counter, n)
  n = n:reverse()
  local a, b = keys[0], bxor(big_endian(n, 1), keys[1])
  local c, d = bxor(big_endian(n, 5), keys[2]), bxor(counter, keys[3])
  for round = 1, 13 do
    local at = 4 * round
    a, b, c, d = aes_column(a, b, c, d, keys[at]), aes_column(b, c, d, a, keys[at + 1]),
                 aes_column(c, d, a, b, keys[at + 2]), aes_column(d, a, b, c, keys[at + 3])
  end
  return word_text(last_column(a, b, c, d, keys[56])) .. word_text(last_column(b, c, d, a, keys[57])) ..
         word_text(last_column(c, d, a, b, keys[58])) .. word_text(last_column(d, a, b, c, keys[59]))
end

-- ---- what the dissector uses ---------------------------------------------------------------------

-- Of each suite: so much of the stream, for the n that stands in a frame as 8 bytes.
local STREAMS = {
  ["chacha20-poly1305"] = function(key, n, size)
    local out = {}
    for i = 1, math.ceil(size / 64) do out[i] = chacha_block(key.bytes, i, n) end
    return table.concat(out)
  end,
  ["aes-256-gcm"] = function(key, n, size)
    local out, keys = {}, round_keys(key)
    for i = 1, math.ceil(size / 16) do out[i] = aes_block(keys, i + 1, n) end
    return table.concat(out)
  end,
}

local ciphers = {}

function ciphers.is_suite(suite)
  return STREAMS[suite] ~= nil
end

-- A key of 32 bytes, as the functions below take it.
function ciphers.key(bytes)
  return {bytes = bytes}
end

function ciphers.decrypt(suite, key, n, text)
  return xor_texts(text, STREAMS[suite](key, n, #text))
end

-- Rule sec-5-5: the key of the next generation.
function ciphers.next_key(suite, key)
  return ciphers.key(STREAMS[suite](key, string.rep("\255", 8), 32):sub(1, 32))
end

return ciphers
