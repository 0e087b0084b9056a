# What the Cap'n Proto peer calls: 48 bytes there and back.
@0xb3d1f0a2c4e59768;

struct Message {
  workNs @0 :UInt64;
  a @1 :Float64;
  b @2 :Float64;
  c @3 :Float64;
  d @4 :Float64;
  e @5 :Float64;
}
interface Echo {
  call @0 (request :Message) -> (reply :Message);
}
