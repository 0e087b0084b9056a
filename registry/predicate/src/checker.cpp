#include "checker.hpp"

#include <string>
#include <utility>

namespace rtpm::predicate {
namespace {

using Kind = Node::Kind;

std::string name_of(Kind kind) {
  switch (kind) {
    case Kind::kNot:
      return "'not'";
    case Kind::kAnd:
      return "'and'";
    case Kind::kOr:
      return "'or'";
    case Kind::kAdd:
      return "'+'";
    case Kind::kSubtract:
    case Kind::kNegate:
      return "'-'";
    case Kind::kMultiply:
      return "'*'";
    case Kind::kDivide:
      return "'/'";
    case Kind::kIn:
      return "'in'";
    default:
      return "'~'";
  }
}

/// Finds the types of all nodes, operands first.
class Checker {
 public:
  Checker(const Nodes& nodes, const TypeOfProperty& type_of_property)
      : nodes_(nodes), type_of_property_(type_of_property) {}

  expected<std::optional<Type>, TextError> check() {
    for (const Node& node : nodes_) {
      types_.push_back(check(node));
      if (error_) return unexpected{std::move(*error_)};
    }
    return types_.empty() ? std::optional(Type::kBool) : types_.back();
  }

 private:
  using Known = std::optional<Type>;

  Known check(const Node& node) {
    switch (node.kind) {
      case Kind::kConstant:
        return type_of(node.constant);
      case Kind::kProperty:
        return type_of_property_ ? type_of_property_(node.property) : std::nullopt;
      case Kind::kExists:
        return Type::kBool;
      case Kind::kNot:
        require(node.left, is_bool, node, "bool");
        return Type::kBool;
      case Kind::kAnd:
      case Kind::kOr:
        require(node.left, is_bool, node, "bool");
        require(node.right, is_bool, node, "bool");
        return Type::kBool;
      case Kind::kContained:
        require(node.left, is_text, node, "text");
        require(node.right, is_text, node, "text");
        return Type::kBool;
      case Kind::kIn:
        return check_in(node);
      case Kind::kCompare:
        return check_comparison(node);
      case Kind::kNegate:
        require(node.left, is_number, node, "numbers");
        return types_[node.left];
      default:
        return check_arithmetic(node);
    }
  }

  Known check_arithmetic(const Node& node) {
    require(node.left, is_number, node, "numbers");
    require(node.right, is_number, node, "numbers");
    const Known left = types_[node.left];
    const Known right = types_[node.right];
    if (node.kind == Kind::kDivide || left == Type::kReal || right == Type::kReal) {
      return Type::kReal;
    }
    return left && right ? Known(Type::kInteger) : std::nullopt;
  }

  Known check_in(const Node& node) {
    require(node.right, is_list, node, "a list");
    const Known item = types_[node.left];
    const Known list = types_[node.right];
    if (!error_ && item && list && !are_comparable(*item, item_type(*list))) {
      fail(node.left, "it is of " + std::string(to_string(*item)) + ", and the list's items of " +
                          std::string(to_string(item_type(*list))));
    }
    return Type::kBool;
  }

  Known check_comparison(const Node& node) {
    const Known left = types_[node.left];
    const Known right = types_[node.right];
    if (node.comparison == Comparison::kHasAnyBit) {
      require_bits(node.left);
      require_bits(node.right);
      return Type::kBool;
    }
    for (const std::uint32_t side : {node.left, node.right}) {
      const Known type = types_[side];
      if (type && is_list(*type)) {
        fail(side, "it is a list, which has no comparison: write 'ITEM in LIST'");
      }
    }
    const bool is_order =
        node.comparison != Comparison::kEqual && node.comparison != Comparison::kNotEqual;
    for (const std::uint32_t side : {node.left, node.right}) {
      if (is_order && types_[side] == Type::kBool) {
        fail(side, "bool is compared with == and != only");
      }
    }
    if (!error_ && left && right && !are_comparable(*left, *right)) {
      fail(node.right, "it is of " + std::string(to_string(*right)) + ", and is compared with " +
                           std::string(to_string(*left)));
    }
    return Type::kBool;
  }

  static bool is_bool(Type type) { return type == Type::kBool; }
  static bool is_text(Type type) { return type == Type::kText; }
  static bool is_number(Type type) { return predicate::is_number(type); }
  static bool is_list(Type type) { return predicate::is_list(type); }
  static bool are_comparable(Type a, Type b) { return a == b || (is_number(a) && is_number(b)); }

  void require(std::uint32_t operand, bool (*fits)(Type), const Node& node, const char* wanted) {
    const Known type = types_[operand];
    if (!type || fits(*type)) return;
    fail(operand, "it is of " + std::string(to_string(*type)) + ", but " + name_of(node.kind) +
                      " takes " + wanted);
  }
  void require_bits(std::uint32_t operand) {
    const Known type = types_[operand];
    if (!type || *type == Type::kInteger) return;
    fail(operand, "it is of " + std::string(to_string(*type)) + ", which has no bits");
  }
  void fail(std::uint32_t number, std::string what) {
    if (!error_) error_ = TextError{nodes_[number].offset, std::move(what)};
  }

  const Nodes& nodes_;
  const TypeOfProperty& type_of_property_;
  std::vector<Known> types_{};
  std::optional<TextError> error_{};
};

}  // namespace

expected<std::optional<Type>, TextError> check_types(const Nodes& nodes,
                                                     const TypeOfProperty& type_of_property) {
  return Checker(nodes, type_of_property).check();
}

}  // namespace rtpm::predicate
