#include "model/verify_limits.hpp"

#include <algorithm>
#include <unordered_map>

namespace rtpm::schema {
namespace {

// Above this count, the message's size is the bound.
constexpr std::uint64_t kCountMax = 65536;

// Limits the verifier's recursion, and so its stack.
constexpr std::uint32_t kDepthMax = 64;

/// Computes a table's limits from its fields' limits, visiting each table once.
class LimitsWalk {
 public:
  explicit LimitsWalk(const Model& model) : model_(model) {}

  VerifyLimits walk(std::size_t index) {
    const auto [state, is_new] = states_.emplace(index, State{});
    if (!is_new) {
      if (!state->second.is_done) return {kRecursiveDepth, 0};
      return state->second.limits;
    }
    VerifyLimits limits;
    std::uint64_t tables = 1;
    bool is_bounded = true;
    for (const Field& field : model_.objects[index].fields) {
      if (field.is_deprecated) continue;
      const VerifyLimits inner = limits_of(field.type);
      if (inner.depth == 0) continue;
      limits.depth = std::max(limits.depth, std::min(inner.depth + 1, kDepthMax));
      is_bounded &= inner.tables != 0 && field.type.base != BaseType::kVector;
      tables = std::min(tables + inner.tables, kCountMax);
    }
    limits.tables = is_bounded && tables < kCountMax ? static_cast<std::uint32_t>(tables) : 0;
    states_[index] = {limits, true};
    return limits;
  }

 private:
  struct State {
    VerifyLimits limits{};
    bool is_done = false;
  };

  /// Depth 0 means no table.
  VerifyLimits limits_of(const Type& type) {
    if (!type.index) return {0, 0};
    if (type.has_object()) {
      return model_.objects[*type.index].is_struct ? VerifyLimits{0, 0} : walk(*type.index);
    }
    VerifyLimits largest{0, 0};
    if (type.innermost() != BaseType::kUnion) return largest;
    bool is_bounded = true;
    for (const EnumValue& value : model_.enums[*type.index].values) {
      const VerifyLimits one = limits_of(value.union_type);
      if (one.depth == 0) continue;
      is_bounded &= one.tables != 0;
      largest = {std::max(largest.depth, one.depth), std::max(largest.tables, one.tables)};
    }
    if (!is_bounded) largest.tables = 0;
    return largest;
  }

  const Model& model_;
  std::unordered_map<std::size_t, State> states_{};
};

}  // namespace

VerifyLimits verify_limits(const Model& model, std::size_t index) {
  return LimitsWalk(model).walk(index);
}

}  // namespace rtpm::schema
