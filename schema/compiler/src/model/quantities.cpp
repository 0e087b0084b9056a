#include "model/quantities.hpp"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "model/spelling.hpp"
#include "model/words.hpp"

namespace rtpm::schema {
namespace {

// More lines would hide the method's own comment.
constexpr std::size_t kLineMax = 40;

class Quantities {
 public:
  explicit Quantities(const Model& model) : model_(model) {}

  void add(std::size_t index, const std::string& path) {
    if (!says_something(index)) return;
    // Describes a recursive table only once.
    if (std::find(open_.begin(), open_.end(), index) != open_.end()) return;
    open_.push_back(index);
    for (const Field& field : model_.objects[index].fields) {
      if (field.is_deprecated) continue;
      const std::string name = path + '.' + field.name + (field.type.is_many() ? "[]" : "");
      add_line(name, field);
      if (const auto inner = object_of(field)) add(*inner, name);
      if (lines_.size() > kLineMax) break;
    }
    open_.pop_back();
  }

  void add_line(const std::string& name, const Field& field) {
    if (const std::string text = quantity(field); !text.empty())
      lines_.push_back(name + ": " + text);
  }

  Documentation take(const std::string& role) {
    if (lines_.size() > kLineMax) {
      lines_.resize(kLineMax);
      lines_.push_back(role + ": more of its fields have units; the schema has them all");
    }
    return std::move(lines_);
  }

 private:
  static std::optional<std::size_t> object_of(const Field& field) noexcept {
    return field.type.has_object() ? field.type.index : std::nullopt;
  }

  /// Whether a field, at any depth, has a unit, a range or a frame. Cached per object, because
  /// types that refer to each other twice on every level would take exponential time.
  bool says_something(std::size_t index) {
    const auto [known, is_new] = says_something_.emplace(index, false);
    if (!is_new) return known->second;
    bool result = false;
    for (const Field& field : model_.objects[index].fields) {
      const auto inner = object_of(field);
      result |= !quantity(field).empty() || (inner && says_something(*inner));
    }
    says_something_[index] = result;
    return result;
  }

  const Model& model_;
  Documentation lines_{};
  std::vector<std::size_t> open_{};
  std::unordered_map<std::size_t, bool> says_something_{};
};

/// "0.0008" for 800.
std::string seconds(std::uint32_t time_us) {
  constexpr std::uint32_t kSecond_us = 1'000'000;
  std::string text = std::to_string(kSecond_us + time_us % kSecond_us);
  text.front() = '.';
  text.erase(text.find_last_not_of(".0") + 1);
  return std::to_string(time_us / kSecond_us) + text;
}

}  // namespace

std::string quantity(const Field& field) {
  std::string text = field.unit;
  if (field.range) {
    text += (text.empty() ? "" : ", ") + number_text(field.range->low) + " to " +
            number_text(field.range->high);
  }
  if (!field.frame.empty()) {
    text.append(text.empty() ? "" : ", ").append("in the frame ").append(field.frame);
  }
  return text;
}

Documentation quantities(const Model& model, const Payload& payload, const std::string& role) {
  if (payload.kind == PayloadKind::kEmpty) return {};
  Quantities lines(model);
  // In C++ the struct itself is the request or reply, so it gets its field's unit, range and frame.
  if (payload.struct_index) lines.add_line(role, model.objects[payload.table].fields.front());
  lines.add(payload.struct_index.value_or(payload.table), role);
  return lines.take(role);
}

std::string waiting_of(OnewayLevel level) {
  switch (level) {
    case OnewayLevel::kSent:
      return "does not wait";
    case OnewayLevel::kReceived:
      return "waits until the server has it";
    case OnewayLevel::kDone:
      break;
  }
  return "waits until it ran";
}

std::string method_facts(const Method& method) {
  std::string text;
  if (method.is_idempotent) text += " Idempotent: may run twice.";
  if (method.oneway) text += " Oneway: " + waiting_of(*method.oneway) + '.';
  if (method.deadline_us) {
    text += " Default deadline " + seconds(*method.deadline_us) + " s.";
  }
  if (method.role != Role::kCommand) {
    text += " Needs the role " + std::string(spelling_of(method.role)) + '.';
  }
  if (method.max_size) {
    text += " Request and reply have at most " + std::to_string(*method.max_size) + " bytes.";
  }
  return text;
}

std::string priority_facts(const Service& service) {
  if (!service.priority) return {};
  const std::string number = std::to_string(*service.priority);
  return service.priority_model == PriorityModel::kServerDeclared
             ? "Its methods run at priority " + number + ", independent of the caller's."
             : "Calls without a priority run at " + number + '.';
}

}  // namespace rtpm::schema
