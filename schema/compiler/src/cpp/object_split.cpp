#include "cpp/object_split.hpp"

#include <cctype>
#include <cstddef>
#include <string>
#include <string_view>

namespace rtpm::schema {
namespace {

constexpr std::string_view kInline = "inline ";

std::string_view take_line(std::string_view& text) noexcept {
  const std::size_t end = text.find('\n');
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(end == std::string_view::npos ? text.size() : end + 1);
  return line;
}

std::string_view take_name(std::string_view text) noexcept {
  std::size_t size = 0;
  while (size < text.size() &&
         (std::isalnum(static_cast<unsigned char>(text[size])) != 0 || text[size] == '_')) {
    ++size;
  }
  return text.substr(0, size);
}

/// Whether a line starts the body of an object-API function, in any of flatc's spellings. Since
/// 23.1 flatc writes `::flatbuffers` instead of `flatbuffers`.
bool begins_body(std::string text) {
  constexpr std::string_view kGlobal = "::flatbuffers::";
  for (std::size_t at = 0; (at = text.find(kGlobal, at)) != std::string::npos;)
    text.erase(at, 2);
  std::string_view line = text;
  // A constructor's initializers are on the following lines.
  if (!line.starts_with(kInline) || !(line.ends_with('{') || line.ends_with(')'))) return false;
  line.remove_prefix(kInline.size());
  constexpr std::string_view kOffset = "flatbuffers::Offset<";
  if (line.starts_with(kOffset)) {
    const std::string name(take_name(line.substr(kOffset.size())));
    const std::string_view rest = line.substr(kOffset.size() + name.size());
    return rest.starts_with("> " + name + "::Pack(flatbuffers::FlatBufferBuilder &_fbb, const " +
                            name + "T* _o") ||
           rest.starts_with("> Create" + name + "(flatbuffers::FlatBufferBuilder &_fbb, const " +
                            name + "T *_o");
  }
  constexpr std::string_view kVoid = "void ";
  if (line.starts_with(kVoid)) {
    const std::string name(take_name(line.substr(kVoid.size())));
    return line.substr(kVoid.size() + name.size())
        .starts_with("::UnPackTo(" + name + "T *_o, const flatbuffers::resolver_function_t ");
  }
  const std::string object(take_name(line));
  if (!object.ends_with('T')) return false;
  const std::string table = object.substr(0, object.size() - 1);
  const std::string_view rest = line.substr(object.size());
  return rest.starts_with("::" + object + "(const " + object + " &o)") ||
         rest.starts_with(" &" + object + "::operator=(" + object + " o)") ||
         rest.starts_with(" *" + table + "::UnPack(const flatbuffers::resolver_function_t ");
}

}  // namespace

SplitHeader split_objects(std::string_view text, std::string_view name) {
  SplitHeader split;
  split.source = "// The object API of " + std::string(name) +
                 ", moved by rtpmc. Do not edit it: change the schema.\n#include \"" +
                 std::string(name) + "\"\n\n";
  bool is_moving = false;
  while (!text.empty()) {
    const std::string_view line = take_line(text);
    const bool is_scope = line.starts_with("namespace ") || line.starts_with("}  // namespace ");
    if (!is_moving && begins_body(std::string(line))) {
      is_moving = true;
      split.source.append(line.substr(kInline.size())).append(1, '\n');
      continue;
    }
    if (is_moving || is_scope) split.source.append(line).append(1, '\n');
    if (!is_moving) split.header.append(line).append(1, '\n');
    if (is_moving && line == "}") {
      is_moving = false;
      split.source += '\n';
    }
  }
  return split;
}

}  // namespace rtpm::schema
