#include "checks/attribute_reader.hpp"

#include <algorithm>
#include <charconv>

namespace rtpm::schema {
namespace {

/// The hint for an RTPM attribute on the wrong kind of declaration.
std::string move_hint(const KnownAttribute& known, AttributePlace place) {
  if (place == AttributePlace::kService && known.place == AttributePlace::kMethod) {
    return "it belongs on its methods, one by one";
  }
  if (place == AttributePlace::kMethod && known.place == AttributePlace::kService) {
    return "it belongs on the service, for all its methods";
  }
  return "it belongs on " + std::string(words_of(known.place)) + "; remove it here";
}

}  // namespace

std::optional<std::uint64_t> to_number(std::string_view text) {
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

bool AttributeReader::is_first(const AttributeUse& use, std::set<std::string>& seen) const {
  if (seen.insert(use.name).second) return true;
  report(use.at, "`" + use.name + "` is stated twice", "keep one of the two");
  return false;
}

void AttributeReader::report_value(const AttributeUse& use, const std::string& hint) const {
  std::string message = "`";
  message.append(use.value.value_or("")).append("` is not a value of `").append(use.name);
  report(use.value_at, message + '`', hint);
}

std::optional<AttributeReader::Value> AttributeReader::read(const AttributeUse& use,
                                                            AttributePlace place,
                                                            const std::string& owner) const {
  const KnownAttribute* known = find_attribute(use.name);
  if (known == nullptr) {
    if (use.name.starts_with("rtpm_")) {
      report(use.at, "unknown attribute `" + use.name + "`", unknown_attribute_hint(use.name));
    } else if (use.name == "offset64" || use.name == "vector64") {
      report(use.at, "`" + use.name + "` makes payloads that RTPM does not carry",
             "remove it: a payload has at most 16 MiB");
    } else if (is_flatbuffers_attribute(use.name) &&
               (place == AttributePlace::kMethod || place == AttributePlace::kService)) {
      const bool has_counterpart =
          place == AttributePlace::kMethod && is_known_attribute("rtpm_" + use.name);
      report_no_effect(use, owner,
                       has_counterpart ? "did you mean `rtpm_" + use.name + "`?" : "remove it");
    }
    return std::nullopt;
  }
  if (known->place != place) {
    report_no_effect(use, owner, move_hint(*known, place));
    return std::nullopt;
  }
  if (known->value == AttributeValue::kNone) {
    if (!use.value) return Value{.number = 1};
    report(use.value_at, "`" + use.name + "` takes no value", value_hint(use.name));
    return std::nullopt;
  }
  if (!use.value) {
    report(use.at, "`" + use.name + "` needs a value", value_hint(use.name));
    return std::nullopt;
  }
  Value value{.number = 1, .text = *use.value};
  bool is_good = true;
  if (known->value == AttributeValue::kNumber) {
    const std::optional<std::uint64_t> number = to_number(*use.value);
    is_good = number && *number >= known->min && *number <= known->max;
    value.number = number.value_or(0);
  } else if (known->value == AttributeValue::kChoice) {
    const auto found = std::find(known->choices.begin(), known->choices.end(), *use.value);
    is_good = found != known->choices.end() && !found->empty();
    value.number = static_cast<std::uint64_t>(found - known->choices.begin());
  } else {
    is_good = is_plain_text(*use.value);
  }
  if (is_good) return value;
  report_value(use, value_hint(use.name));
  return std::nullopt;
}

}  // namespace rtpm::schema
