#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "rtpm/names/storage.hpp"
#include "rtpm/rt/host.hpp"

namespace rtpm::etcd_store {

/// The value of a name's key, in JSON, so that etcdctl shows it:
///
///     {"version": 1, "url": "rtpm://…", "interface": "lab.Arm", "owner": ["12", "3"],
///      "holder": "0", "host": 2130706433, "where": "77", "lease_ns": "2000000000", "write":
///      "81985529216486895", "properties": [{"name": "force", "type": "real", "value": 3.5, "unit":
///      "newton"}]}
struct StoredValue {
  /// Lacks name and change, which the key provides. Revision 0 means that the key's revision is the
  /// holder's.
  names::StoredName stored{};
  /// Identifies the write, to distinguish it from other registries' writes.
  std::uint64_t write = 0;
  /// The host of the registry that wrote it: rt::clock_domain().
  std::uint64_t where = rt::clock_domain();
};

[[nodiscard]] std::string to_text(const StoredValue& value);
/// Parses a value; nullopt if the text has another form.
[[nodiscard]] std::optional<StoredValue> parse_value(std::string_view text);

}  // namespace rtpm::etcd_store
