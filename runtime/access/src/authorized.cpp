#include "rtpm/access/authorized.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "rtpm/base/expected.hpp"
#include "rtpm/base/printable.hpp"
#include "rtpm/base/whole_number.hpp"
#include "rtpm/crypto/key_text.hpp"
#include "words.hpp"

namespace rtpm::access {
namespace {

struct Fault {
  std::size_t column = 1;
  std::string why{};
};

unexpected<Fault> fault_at(const Word& word, std::string why) {
  return {{word.column, std::move(why)}};
}

std::string quoted(std::string_view text) {
  return "'" + printable(text, 64) + "'";
}

/// Parses the subject at the beginning of a line, which takes one or two words.
expected<Subject, Fault> read_subject(const std::vector<Word>& words, std::size_t& next) {
  const Word& first = words[next++];
  Subject subject;
  if (first.text == "anonymous") return subject;
  if (first.text.starts_with("uid:")) {
    const auto user = whole_number_of<std::uint32_t>(first.text.substr(4));
    if (!user) return fault_at(first, quoted(first.text) + " has no number of a user, as uid:1000");
    if (*user == kUnknownUser)
      return fault_at(
          first,
          "uid:65534 stands for every user that the kernel can't name, such as those of "
          "containers; grant something to a user of its own");
    subject.kind = Subject::Kind::kLocalUser;
    subject.user = *user;
    return subject;
  }
  if (first.text != crypto::kKeyTextName)
    return fault_at(first, "a line begins with rtpm25519 and a key, uid:NUMBER or anonymous, not " +
                               quoted(first.text));
  subject.kind = Subject::Kind::kKey;
  if (next == words.size() || !crypto::decode_key(words[next].text, subject.key))
    return fault_at(next == words.size() ? first : words[next],
                    "a public key has 44 characters of Base64; `rtpm key show` prints one");
  ++next;
  return subject;
}

template <typename Item>
expected<std::vector<Item>, Fault> read_list(const Word& value, std::string_view what) {
  std::vector<Item> list;
  for (const Word& word : items_of(value)) {
    auto item = Item::parse(word.text);
    if (!item) return fault_at(word, quoted(word.text) + " is not " + std::string(what));
    if (list.size() == kGrantItemCountMax)
      return fault_at(word,
                      "a line has at most " + std::to_string(kGrantItemCountMax) + " of them");
    list.push_back(std::move(*item));
  }
  return list;
}

expected<void, Fault> read_setting(const Word& key, const Word& value, Grant& grant) {
  if (key.text == "name") {
    grant.name = value.text;
  } else if (key.text == "role") {
    const auto role = role_named(value.text);
    if (!role)
      return fault_at(
          value, "a role is observe, command, configure or administer, not " + quoted(value.text));
    grant.role = *role;
  } else if (key.text == "on") {
    auto objects =
        read_list<ObjectPattern>(value, "a pattern of objects, as lab/arm0, lab/* or lab/**");
    if (!objects) return unexpected{objects.error()};
    grant.objects = std::move(*objects);
  } else if (key.text == "max-priority") {
    const auto priority = whole_number_of<int>(value.text);
    if (!priority || !Priority::is_valid(*priority))
      return fault_at(value, "a priority is 0 to 32767, not " + quoted(value.text));
    grant.ceiling = *priority;
  } else if (key.text == "from") {
    auto ranges = read_list<AddressRange>(
        value, "an address or a range of them, as 192.168.7.0/24 with zeros behind 24 bits");
    if (!ranges) return unexpected{ranges.error()};
    grant.from = std::move(*ranges);
  } else {
    return fault_at(key, "unknown setting " + quoted(key.text) +
                             "; there are name, role, on, max-priority and from");
  }
  return {};
}

expected<Grant, Fault> read_line(std::string_view line) {
  if (line.size() > kGrantLineSizeMax)
    return fault_at({{}, kGrantLineSizeMax + 1},
                    "a line has at most " + std::to_string(kGrantLineSizeMax) + " bytes");
  const std::vector<Word> words = words_of(line);
  std::size_t next = 0;
  const auto subject = read_subject(words, next);
  if (!subject) return unexpected{subject.error()};
  Grant grant;
  grant.subject = *subject;
  std::vector<std::string_view> seen;
  for (; next < words.size(); ++next) {
    const Word& word = words[next];
    const std::size_t equal = word.text.find('=');
    const Word key{word.text.substr(0, equal), word.column};
    if (equal == std::string_view::npos)
      return fault_at(word, "a setting is NAME=VALUE, without spaces; not " + quoted(word.text));
    if (std::ranges::find(seen, key.text) != seen.end())
      return fault_at(word, quoted(key.text) + " is given twice");
    seen.push_back(key.text);
    const Word value{word.text.substr(equal + 1), word.column + equal + 1};
    if (auto read = read_setting(key, value, grant); !read) return unexpected{read.error()};
  }
  const Word end{{}, line.size() + 1};
  if (grant.role == Role::kNone) return fault_at(end, "role= is missing, as role=observe");
  if (grant.objects.empty()) return fault_at(end, "on= is missing, as on=lab/** or on=**");
  return grant;
}

}  // namespace

Authorized parse_authorized(std::string_view text) {
  Authorized result;
  visit_lines(text, [&](std::string_view line, std::size_t number) {
    auto grant = read_line(line);
    if (grant && result.grants.size() == kGrantCountMax)
      grant = unexpected<Fault>{
          {1, "a file has at most " + std::to_string(kGrantCountMax) + " grants"}};
    if (grant) {
      result.grants.push_back(std::move(*grant));
      return;
    }
    if (++result.fault_count <= kFaultCountMax)
      result.faults.push_back({number, grant.error().column, std::move(grant.error().why)});
  });
  return result;
}

std::string to_text(const LineFault& fault, std::string_view file) {
  return printable(file) + ':' + std::to_string(fault.line) + ':' + std::to_string(fault.column) +
         ": " + fault.why;
}

std::string to_line(const Grant& grant) {
  std::string line = to_text(grant.subject);
  if (!grant.name.empty()) line += " name=" + grant.name;
  line += " role=";
  line += to_string(grant.role);
  const char* separator = " on=";
  for (const ObjectPattern& object : grant.objects)
    line += std::exchange(separator, ",") + object.text();
  if (grant.ceiling < Priority::kHighest)
    line += " max-priority=" + std::to_string(grant.ceiling.value());
  separator = " from=";
  for (const AddressRange& range : grant.from)
    line += std::exchange(separator, ",") + range.text();
  return line;
}

}  // namespace rtpm::access
