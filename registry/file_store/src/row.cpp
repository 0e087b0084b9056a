#include "row.hpp"

#include <utility>

#include "encoding.hpp"
#include "rtpm/base/hash.hpp"

namespace rtpm::file_store {
namespace {

// SQLite's integers are signed.
std::int64_t as_signed(std::uint64_t value) noexcept {
  return static_cast<std::int64_t>(value);
}
std::uint64_t as_unsigned(std::int64_t value) noexcept {
  return static_cast<std::uint64_t>(value);
}

std::uint64_t checksum_of(const names::StoredName& stored, std::string_view properties) {
  std::uint64_t checksum = fnv1a_64(stored.name, 1);
  checksum = fnv1a_64(stored.url, checksum);
  checksum = fnv1a_64(stored.interface, checksum);
  checksum = fnv1a_64(properties, checksum);
  std::string numbers;
  for (const std::uint64_t number : {stored.owner.id, stored.owner.epoch, stored.revision,
                                     stored.change, stored.host, as_unsigned(stored.lease.count())})
    numbers += std::to_string(number) + ",";
  return fnv1a_64(numbers, checksum);
}

}  // namespace

void bind_row(Statement& statement, const names::StoredName& stored,
              const std::string& properties) {
  int number = 0;
  for (const std::string* text : {&stored.name, &stored.url, &stored.interface})
    statement.bind(++number, std::string_view(*text));
  for (const std::uint64_t value : {stored.owner.id, stored.owner.epoch, stored.revision,
                                    stored.change, stored.host, as_unsigned(stored.lease.count())})
    statement.bind(++number, as_signed(value));
  statement.bind(++number, std::string_view(properties));
  statement.bind(++number, as_signed(checksum_of(stored, properties)));
}

std::optional<names::StoredName> read_row(const Statement& statement, int first) {
  const auto text = [&](int column) { return std::string(statement.text(first + column)); };
  const auto number = [&](int column) { return as_unsigned(statement.integer(first + column)); };
  names::StoredName stored{.name = text(0),
                           .url = text(1),
                           .interface = text(2),
                           .owner = {number(3), number(4)},
                           .revision = number(5),
                           .change = number(6),
                           .host = number(7),
                           .lease = Duration{statement.integer(first + 8)}};
  const std::string properties = text(9);
  if (checksum_of(stored, properties) != number(10)) return std::nullopt;
  auto read = decode(properties);
  if (!read) return std::nullopt;
  stored.properties = std::move(*read);
  return stored;
}

}  // namespace rtpm::file_store
