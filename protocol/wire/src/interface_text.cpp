#include "rtpm/wire/interface_text.hpp"

#include <algorithm>
#include <array>
#include <set>
#include <unordered_map>
#include <utility>
#include <vector>

#include "interface_reader.hpp"

namespace rtpm::wire {
namespace {

std::string quoted(std::string_view text) {
  return '`' + std::string(text) + '`';
}

/// "`x: int32` there and `x: double` here"
std::string two_sides(std::string_view there, std::string_view here) {
  return quoted(there) + " there and " + quoted(here) + " here";
}

/// True if one side leaves it open, or both state the same.
bool agrees(std::string_view a, std::string_view b) noexcept {
  return a.empty() || b.empty() || a == b;
}

/// Compares the types of one message, starting with its table.
class MessageComparison {
 public:
  /// `is_request`: the client writes.
  MessageComparison(const InterfaceText& client, const InterfaceText& server,
                    bool is_request) noexcept
      : client_(client), server_(server), is_request_(is_request) {}

  std::optional<std::string> run(std::string_view table) {
    reach(table);
    while (!open_.empty()) {
      const std::string_view name = open_.back();
      open_.pop_back();
      if (auto difference = compare(name)) return difference;
    }
    return std::nullopt;
  }

 private:
  using Difference = std::optional<std::string>;

  void reach(std::string_view name) {
    if (!name.empty() && seen_.insert(name).second) open_.push_back(name);
  }

  Difference compare(std::string_view name) {
    const auto here = client_.types.find(name);
    const auto there = server_.types.find(name);
    if (here == client_.types.end() || there == server_.types.end()) {
      return "type " + quoted(name) + " is missing in the text of one side";
    }
    if (here->second.head != there->second.head) {
      return "a type is " + two_sides(there->second.head, here->second.head);
    }
    if (here->second.kind == "table") return compare_fields(here->second, there->second);
    if (here->second.kind == "struct") return compare_struct(here->second, there->second);
    return compare_values(here->second, there->second);
  }

  Difference compare_struct(const TypeText& here, const TypeText& there) {
    if (here.members.size() != there.members.size()) {
      return "struct " + quoted(here.name) + " has other fields there";
    }
    return compare_fields(here, there);
  }

  Difference compare_fields(const TypeText& here, const TypeText& there) {
    const TypeText& writer = is_request_ ? here : there;
    const TypeText& reader = is_request_ ? there : here;
    for (const std::string_view line : reader.members) {
      const auto wanted = read_field(line);
      if (!wanted) return "a field cannot be read: " + quoted(line);
      const std::string_view* other = nullptr;
      for (const std::string_view& candidate : writer.members) {
        if (id_of(candidate) == wanted->id) other = &candidate;
      }
      if (other == nullptr) {
        if (here.kind != "struct" && !wanted->needs_value()) continue;
        return "field " + quoted(line) + " of " + quoted(here.head) + " is missing " +
               (is_request_ ? "here" : "there");
      }
      const auto written = read_field(*other);
      if (!written) return "a field cannot be read: " + quoted(*other);
      if (!is_same(*written, *wanted)) {
        return "field " + std::string(wanted->id) + " of " + quoted(here.head) + " is " +
               (is_request_ ? two_sides(line, *other) : two_sides(*other, line));
      }
      reach(wanted->type_name);
    }
    return std::nullopt;
  }

  static bool is_same(const FieldText& written, const FieldText& wanted) noexcept {
    if (written.name != wanted.name || written.type != wanted.type ||
        written.type_name != wanted.type_name || written.is_key != wanted.is_key ||
        written.encodings != wanted.encodings || !agrees(written.unit, wanted.unit) ||
        !agrees(written.frame, wanted.frame)) {
      return false;
    }
    if (wanted.needs_value() && !written.needs_value()) return false;
    // A deprecated field is neither written nor read.
    if (written.is_deprecated || wanted.is_deprecated) return true;
    const bool is_number = !wanted.default_value.empty();
    return written.default_value == wanted.default_value &&
           (!is_number || written.is_optional == wanted.is_optional);
  }

  /// Values of enumerations and unions that both sides know must be equal.
  Difference compare_values(const TypeText& here, const TypeText& there) {
    for (const std::string_view line : here.members) {
      const auto ours = read_value(line);
      if (!ours) return "a value cannot be read: " + quoted(line);
      for (const std::string_view other : there.members) {
        const auto theirs = read_value(other);
        if (!theirs) return "a value cannot be read: " + quoted(other);
        const bool is_name = ours->name == theirs->name;
        if (is_name != (ours->number == theirs->number) ||
            (is_name && ours->type != theirs->type)) {
          return "a value of " + quoted(here.head) + " is " + two_sides(other, line);
        }
        if (is_name) reach(ours->type_name);
      }
    }
    return std::nullopt;
  }

  const InterfaceText& client_;
  const InterfaceText& server_;
  bool is_request_;
  std::set<std::string_view> seen_{};
  std::vector<std::string_view> open_{};
};

std::optional<std::string> compare_methods(const InterfaceText& client, const MethodText& here,
                                           const InterfaceText& server, const MethodText& there) {
  if (here.name != there.name) return "it is " + two_sides(there.name, here.name);
  if (here.manner != there.manner) {
    const auto words = [](std::string_view manner) {
      return manner.empty() ? std::string_view("a call with a reply") : manner;
    };
    return "it is " + two_sides(words(there.manner), words(here.manner));
  }
  if (here.is_idempotent && !there.is_idempotent) {
    return "it is idempotent here, so that it would be repeated, and not there";
  }
  if (here.request != there.request) return "it takes " + two_sides(there.request, here.request);
  if (here.reply != there.reply) return "it gives " + two_sides(there.reply, here.reply);
  if (auto difference = MessageComparison(client, server, true).run(here.request_table())) {
    return difference;
  }
  return MessageComparison(client, server, false).run(here.reply_table());
}

}  // namespace

// hp-12.2-2
std::optional<std::string> find_obstacle(std::string_view client, std::string_view server) {
  const auto ours = read_interface(client);
  const auto theirs = read_interface(server);
  if (!ours || !theirs) return "the text of its interface cannot be read";
  if (ours->name != theirs->name) return "the interface is " + two_sides(theirs->name, ours->name);
  for (const MethodText& method : ours->methods) {
    const std::string words =
        "method '" + std::string(method.name) + "' (id " + std::string(method.id) + ')';
    const auto other = std::ranges::find(theirs->methods, method.id, &MethodText::id);
    if (other == theirs->methods.end()) return words + " is missing there";
    if (auto difference = compare_methods(*ours, method, *theirs, *other)) {
      return words + ": " + *difference;
    }
  }
  return std::nullopt;
}

}  // namespace rtpm::wire
