#include "content.hpp"

#include <algorithm>
#include <chrono>

#include "base64.hpp"
#include "rtpm/base/hash.hpp"
#include "stored_value.hpp"

namespace rtpm::etcd_store {
namespace {

using namespace std::chrono_literals;

/// Keeps a page well below kReplySizeMax: 512 names with all their properties take 5 MiB.
constexpr int kPageSize = 512;
constexpr std::uint64_t kFenceCount = 64;

expected<Json, GatewayError> read_page(Gateway& gateway, Json range, std::uint64_t revision,
                                       MonotonicTime deadline) {
  range["limit"] = kPageSize;
  if (revision != 0) range["revision"] = std::to_string(revision);
  return gateway.ask("/v3/kv/range", range, deadline);
}

// With its usual election timeout of 1 s, etcd grants no shorter leases.
constexpr std::uint64_t kLeaseSecondsMin = 2;
// etcd checks every half second for leases that have ended.
constexpr Duration kEndingMax = 1s;

}  // namespace

std::uint64_t seconds_of(Duration lease) noexcept {
  const auto seconds = static_cast<std::uint64_t>((lease + 999'999'999ns) / 1s);
  return std::max(seconds, kLeaseSecondsMin);
}

Json Keys::all() const {
  std::string end = names_;
  ++end.back();
  return {{"key", to_base64(names_)}, {"range_end", to_base64(end)}};
}

std::optional<std::string> Keys::name_of(std::string_view key) const {
  if (!key.starts_with(names_)) return std::nullopt;
  return std::string(key.substr(names_.size()));
}

std::string Keys::fence_of(std::string_view name) const {
  return fences_ + std::to_string(fnv1a_64(name, 0) % kFenceCount);
}

ReadName read_name(const std::string& name, const KeyValue& key_value) {
  ReadName read{{.revision = key_value.mod_revision,
                 .etcd_lease = key_value.lease,
                 .value_hash = fnv1a_64(key_value.value, 0)},
                std::nullopt};
  auto value = parse_value(key_value.value);
  read.known.is_foreign = !value;
  if (!value) return read;
  names::StoredName& stored = value->stored;
  stored.name = name;
  stored.change = key_value.mod_revision;
  if (stored.revision == 0) stored.revision = key_value.mod_revision;
  if (!stored.is_permanent()) stored.stay = Duration{seconds_of(stored.lease) * 1s} + kEndingMax;
  read.known.lease = stored.lease;
  read.stored = std::move(stored);
  return read;
}

expected<Content, GatewayError> read_content(Gateway& gateway, const Keys& keys,
                                             MonotonicTime deadline, std::uint64_t revision) {
  Content content;
  content.revision = revision;
  Json range = keys.all();
  for (;;) {
    const auto page = read_page(gateway, range, content.revision, deadline);
    if (!page) return unexpected{page.error()};
    if (content.revision == 0) content.revision = number_at(object_at(*page, "header"), "revision");
    std::string last;
    for (const Json& each : object_at(*page, "kvs")) {
      const auto key_value = key_value_of(each);
      const auto name = key_value ? keys.name_of(key_value->key) : std::nullopt;
      if (!name || key_value->key <= last) {
        return unexpected{GatewayError{"it answers with keys that were not asked for"}};
      }
      last = key_value->key;
      ReadName read = read_name(*name, *key_value);
      content.known.emplace(*name, read.known);
      if (read.stored) content.names.push_back(std::move(*read.stored));
      if (!read.stored) ++content.foreign_count;
    }
    if (!object_at(*page, "more").is_boolean() || last.empty()) return content;
    range["key"] = to_base64(last + '\0');
  }
}

}  // namespace rtpm::etcd_store
