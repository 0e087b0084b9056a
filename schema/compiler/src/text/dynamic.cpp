#include "rtpm/schema/dynamic.hpp"

#include <flatbuffers/idl.h>
#include <flatbuffers/reflection.h>

#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <type_traits>
#include <utility>

#include "reading/closed_parser.hpp"
#include "reading/flat_arrays.hpp"
#include "reading/reflection.hpp"
#include "rtpm/schema/compile.hpp"
#include "rtpm/schema/schema_text.hpp"
#include "text/json_outline.hpp"
#include "text/range_check.hpp"
#include "text/text_size.hpp"

namespace rtpm::schema {
namespace {

constexpr const char* kFileName = "schema";

/// The nesting limit of tables in a payload.
constexpr flatbuffers::uoffset_t kDepthMax = 64;
/// The size of a root and its vtable, in bytes.
constexpr std::size_t kTableSizeMin = 8;
/// Limit of the JSON, in bytes.
constexpr std::size_t kTextSizeMax = std::size_t{64} * 1024 * 1024;

/// Makes the parser treat nested buffers as plain bytes: otherwise it would follow their offsets,
/// which nothing verifies.
void keep_nested_bytes(const flatbuffers::Parser& parser) {
  for (const flatbuffers::StructDef* type : parser.structs_.vec) {
    for (flatbuffers::FieldDef* field : type->fields.vec) {
      field->nested_flatbuffer = nullptr;
      field->flexbuffer = false;
    }
  }
}

/// FlatBuffers' parser for the same schema text; it reads and writes JSON.
std::unique_ptr<flatbuffers::Parser> make_parser(const std::string& text) {
  flatbuffers::IDLOptions options;
  options.strict_json = false;
  options.indent_step = -1;
  options.output_default_scalars_in_json = true;
  // The language determines which features the parser accepts; the compiler uses the same.
  options.lang_to_generate = flatbuffers::IDLOptions::kCpp;
  auto parser = std::make_unique<flatbuffers::Parser>(options);
  if (!parse_closed(*parser, text.c_str())) return nullptr;
  keep_nested_bytes(*parser);
  return parser;
}

/// The parser's reflection.
std::vector<std::byte> serialized(flatbuffers::Parser& parser) {
  parser.Serialize();
  const auto view =
      std::as_bytes(std::span(parser.builder_.GetBufferPointer(), parser.builder_.GetSize()));
  return {view.begin(), view.end()};
}

/// Renumbers the parser's "2: 5: error: …" for the text without its first line.
std::string without_first_line(const std::string& error) {
  const std::size_t end = error.find_first_not_of("0123456789");
  if (end == 0 || end > 6 || end == std::string::npos) return error;
  return std::to_string(std::stoul(error.substr(0, end)) - 1) + error.substr(end);
}

/// The offset in the text of "2: 5: error: …"; beyond its end if the error states no position.
std::size_t offset_in(std::string_view text, const std::string& error) {
  unsigned line = 0;
  unsigned column = 0;
  if (std::sscanf(error.c_str(), "%6u: %6u:", &line, &column) != 2) return text.size() + 1;
  std::size_t begin = 0;
  for (; line > 1 && begin < text.size(); --line)
    begin = std::min(text.find('\n', begin), text.size() - 1) + 1;
  return std::min(begin + column, text.size());
}

/// The parser's error, with the field that caused it.
std::string with_field(const Model& model, std::size_t object, const std::string& error,
                       std::string_view text) {
  const auto is_about = [&](const char* what) { return error.find(what) != std::string::npos; };
  if (is_about("unknown field")) return error;  // The error names the field itself.
  const JsonOutline whole = outline_of(text);
  if (is_about("wrong number of initializers")) {
    const std::string lacking = lacking_fields(model, object, whole);
    return lacking.empty() ? error : lacking;
  }
  const bool is_late = is_about("invalid number") || is_about("array size");
  const std::string field = is_late ? misfit_field(model, object, whole)
                                    : field_before(whole, text, offset_in(text, error));
  return field.empty() ? error : error + ", in the field '" + field + "'";
}

}  // namespace

class Dynamic::Impl {
 public:
  /// @errors nullptr and the reason in `error`: not a schema
  static std::unique_ptr<Impl> make(const std::string& schema, std::string& error);

  Model model{};
  std::size_t service = 0;
  Payload event{};
  std::unique_ptr<flatbuffers::Parser> parser{};
  std::string reflection{};  // A serialized schema, for verification.

  /// The table's description in the reflection.
  [[nodiscard]] const reflection::Object& object(const Payload& payload) const {
    return *reflection::GetSchema(reflection.data())
                ->objects()
                ->LookupByKey(model.objects[payload.table].name.c_str());
  }
  /// Whether `bytes`, aligned, are a FlatBuffer of the payload's table.
  [[nodiscard]] bool is_valid(const Payload& payload, std::span<const std::byte> bytes) const {
    if (bytes.size() < kTableSizeMin) return false;
    const auto* data = static_cast<const std::uint8_t*>(static_cast<const void*>(bytes.data()));
    // A table has at least a 4-byte offset to its vtable, so more tables would have to share bytes.
    const auto table_max = static_cast<flatbuffers::uoffset_t>(bytes.size() / 4);
    return flatbuffers::Verify(*reflection::GetSchema(reflection.data()), object(payload), data,
                               bytes.size(), kDepthMax, table_max);
  }
  [[nodiscard]] const Field& only_field(const Payload& payload) const {
    return model.objects[payload.table].fields.front();
  }
  /// Whether the JSON of a bare struct is enclosed in its table, as in the schema's text.
  [[nodiscard]] bool is_in_its_table(const Payload& payload, std::string_view json) const {
    const std::string& name = only_field(payload).name;
    const std::vector<Field>& fields = model.objects[*payload.struct_index].fields;
    return only_name(json) == name && std::ranges::find(fields, name, &Field::name) == fields.end();
  }
};

Dynamic::Dynamic(std::unique_ptr<Impl> impl) noexcept : impl_(std::move(impl)) {}
Dynamic::~Dynamic() = default;

std::unique_ptr<Dynamic::Impl> Dynamic::Impl::make(const std::string& schema, std::string& error) {
  CompileResult compiled = compile_text(schema, kFileName);
  if (!compiled.model) {
    error = render(compiled.errors);
    return nullptr;
  }
  auto impl = std::make_unique<Impl>();
  impl->model = *std::move(compiled.model);
  impl->parser = make_parser(schema);
  if (!impl->parser) {
    error = "FlatBuffers' parser does not take the schema";
    return nullptr;
  }
  impl->parser->Serialize();
  const auto* bytes = static_cast<const void*>(impl->parser->builder_.GetBufferPointer());
  impl->reflection.assign(static_cast<const char*>(bytes), impl->parser->builder_.GetSize());
  return impl;
}

std::unique_ptr<Dynamic> Dynamic::make(const std::string& schema, std::string_view name,
                                       std::string& error) {
  auto impl = Impl::make(schema, error);
  if (!impl) return nullptr;
  const auto found = std::ranges::find(impl->model.services, name, &Service::name);
  if (found == impl->model.services.end()) {
    error = "the schema has no service " + std::string(name);
    return nullptr;
  }
  impl->service = static_cast<std::size_t>(found - impl->model.services.begin());
  return std::unique_ptr<Dynamic>(new Dynamic(std::move(impl)));
}

std::unique_ptr<Dynamic> Dynamic::make(const std::string& schema, std::string& error) {
  auto impl = Impl::make(schema, error);
  return impl ? std::unique_ptr<Dynamic>(new Dynamic(std::move(impl))) : nullptr;
}

std::unique_ptr<Dynamic> Dynamic::make_for_event(const std::string& schema, std::string_view name,
                                                 std::string& error) {
  auto impl = Impl::make(schema, error);
  if (!impl) return nullptr;
  const auto found = std::ranges::find(impl->model.objects, name, &Object::name);
  if (found == impl->model.objects.end() || !found->event_id) {
    error = "the schema has no event " + std::string(name);
    return nullptr;
  }
  impl->event =
      payload_of(impl->model, static_cast<std::size_t>(found - impl->model.objects.begin()));
  return std::unique_ptr<Dynamic>(new Dynamic(std::move(impl)));
}

const Model& Dynamic::model() const noexcept {
  return impl_->model;
}

const Service& Dynamic::service() const noexcept {
  return impl_->model.services[impl_->service];
}

const Payload& Dynamic::event() const noexcept {
  return impl_->event;
}

std::span<const std::byte> Dynamic::reflection() const noexcept {
  return std::as_bytes(std::span(impl_->reflection));
}

const Method* Dynamic::find(std::string_view method) const noexcept {
  for (const Method& candidate : service().methods) {
    if (candidate.name == method) return &candidate;
  }
  return nullptr;
}

std::optional<std::vector<std::byte>> Dynamic::encode(const Payload& payload, std::string_view json,
                                                      std::string& error) {
  if (payload.kind == PayloadKind::kEmpty) {
    if (json.empty() || json == "{}") return std::vector<std::byte>{};
    error = "the method takes nothing: leave the argument out";
    return std::nullopt;
  }
  const std::string given(json.empty() ? "{}" : json);
  const bool is_struct = payload.kind == PayloadKind::kStruct;
  const bool is_bare = is_struct && !impl_->is_in_its_table(payload, given);
  // The name is on a separate line, so that errors have the columns of the caller's text.
  const std::string text =
      is_bare ? "{ " + impl_->only_field(payload).name + ":\n" + given + " }" : given;
  flatbuffers::Parser& parser = *impl_->parser;
  if (!parser.SetRootType(impl_->model.objects[payload.table].name.c_str()) ||
      !parse_closed(parser, text.c_str())) {
    error = with_field(impl_->model, is_bare ? *payload.struct_index : payload.table,
                       is_bare ? without_first_line(parser.error_) : parser.error_, given);
    return std::nullopt;
  }
  error = out_of_range(impl_->model, payload.table, parser.builder_.GetBufferPointer());
  if (is_struct && !error.empty()) error.erase(0, impl_->only_field(payload).name.size() + 1);
  if (!error.empty()) return std::nullopt;
  std::span<const std::uint8_t> bytes(parser.builder_.GetBufferPointer(),
                                      parser.builder_.GetSize());
  if (is_struct) {
    const auto* root = flatbuffers::GetRoot<flatbuffers::Table>(bytes.data());
    const auto slot = impl_->object(payload).fields()->Get(0)->offset();
    bytes = {root->GetAddressOf(slot), impl_->model.objects[*payload.struct_index].byte_size};
  }
  const auto view = std::as_bytes(bytes);
  return std::vector<std::byte>(view.begin(), view.end());
}

std::optional<std::vector<std::byte>> Dynamic::as_table(const Payload& payload,
                                                        std::span<const std::byte> bytes) {
  if (payload.kind == PayloadKind::kEmpty) {
    if (!bytes.empty()) return std::nullopt;
    flatbuffers::FlatBufferBuilder builder;
    const auto start = builder.StartTable();
    builder.Finish(flatbuffers::Offset<flatbuffers::Table>(builder.EndTable(start)));
    const auto view = std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize()));
    return std::vector<std::byte>(view.begin(), view.end());
  }
  if (payload.kind == PayloadKind::kStruct) {
    const Object& object = impl_->model.objects[*payload.struct_index];
    if (bytes.size() != object.byte_size) return std::nullopt;
    flatbuffers::FlatBufferBuilder builder;
    const auto start = builder.StartTable();
    builder.Align(object.alignment);
    builder.PushBytes(static_cast<const std::uint8_t*>(static_cast<const void*>(bytes.data())),
                      bytes.size());
    builder.AddStructOffset(impl_->object(payload).fields()->Get(0)->offset(), builder.GetSize());
    builder.Finish(flatbuffers::Offset<flatbuffers::Table>(builder.EndTable(start)));
    const auto view = std::as_bytes(std::span(builder.GetBufferPointer(), builder.GetSize()));
    return std::vector<std::byte>(view.begin(), view.end());
  }
  // The verifier needs aligned bytes.
  std::vector<std::byte> copy(bytes.begin(), bytes.end());
  if (!impl_->is_valid(payload, copy)) return std::nullopt;
  return copy;
}

std::optional<std::vector<std::byte>> Dynamic::from_table(const Payload& payload,
                                                          std::span<const std::byte> bytes) {
  if (payload.kind == PayloadKind::kEmpty && bytes.empty()) return std::vector<std::byte>{};
  std::vector<std::byte> copy(bytes.begin(), bytes.end());
  if (!impl_->is_valid(payload, copy)) return std::nullopt;
  if (payload.kind == PayloadKind::kEmpty) return std::vector<std::byte>{};
  if (payload.kind == PayloadKind::kTable) return copy;
  const auto* data = static_cast<const std::uint8_t*>(static_cast<const void*>(copy.data()));
  const auto* root = flatbuffers::GetRoot<flatbuffers::Table>(data);
  const std::uint8_t* only = root->GetAddressOf(impl_->object(payload).fields()->Get(0)->offset());
  if (only == nullptr) return std::nullopt;
  const auto view =
      std::as_bytes(std::span(only, impl_->model.objects[*payload.struct_index].byte_size));
  return std::vector<std::byte>(view.begin(), view.end());
}

std::string Dynamic::refusal(const Payload& payload, std::span<const std::byte> bytes) {
  const auto table = as_table(payload, bytes);
  if (!table) return "the bytes are no " + impl_->model.objects[payload.table].name;
  std::string text =
      out_of_range(impl_->model, payload.table,
                   static_cast<const std::uint8_t*>(static_cast<const void*>(table->data())));
  if (payload.kind == PayloadKind::kStruct && !text.empty()) {
    text.erase(0, impl_->only_field(payload).name.size() + 1);
  }
  return text;
}

std::vector<std::byte> Dynamic::reflection_of(const Payload& payload) const {
  const auto parser = make_parser(schema_text(impl_->model, impl_->model.objects[payload.table]));
  if (!parser) return {};  // Can't fail: the text is made from one that the parser accepted.
  return serialized(*parser);
}

std::vector<std::byte> Dynamic::flat_reflection(std::string_view table) const {
  const std::vector<Object>& objects = impl_->model.objects;
  const auto found = std::ranges::find(objects, table, &Object::name);
  if (found == objects.end()) return {};
  // FlatBuffers writes declared attributes only.
  std::string text = "attribute \"";
  text.append(kArrayAttribute).append("\";\n").append(schema_text(impl_->model, *found));
  const auto parser = make_parser(text);
  if (!parser) return {};  // Can't fail, like reflection_of().
  flatten_arrays(*parser);
  return serialized(*parser);
}

std::optional<std::string> Dynamic::decode(const Payload& payload,
                                           std::span<const std::byte> bytes) {
  if (payload.kind == PayloadKind::kEmpty) {
    return bytes.empty() ? std::optional<std::string>("{}") : std::nullopt;
  }
  // FlatBuffers can't print a bare struct.
  const auto table = as_table(payload, bytes);
  if (!table) return std::nullopt;
  return print(payload, static_cast<const std::uint8_t*>(static_cast<const void*>(table->data())));
}

std::optional<std::string> Dynamic::print(const Payload& payload, const std::uint8_t* data) {
  flatbuffers::Parser& parser = *impl_->parser;
  if (!has_text_of_at_most(kTextSizeMax, impl_->model, payload.table, data) ||
      !parser.SetRootType(impl_->model.objects[payload.table].name.c_str())) {
    return std::nullopt;
  }
  parser.opts.strict_json = true;
  std::string text;
  // Returns true on success or, since 23.5.8, the text of an error.
#if FLATBUFFERS_VERSION_MAJOR == 23 && FLATBUFFERS_VERSION_REVISION == 26
  const auto result = flatbuffers::GenText(parser, data, &text);  // 23.5.26 has no other name.
#else
  const auto result = flatbuffers::GenerateText(parser, data, &text);
#endif
  parser.opts.strict_json = false;
  if (static_cast<bool>(result) != std::is_same_v<decltype(result), const bool>)
    return std::nullopt;
  text = with_null_for_no_number(text);
  if (payload.kind != PayloadKind::kStruct) return text;
  // Keeps only the struct of `{"field": {…}}`.
  const std::size_t begin = text.find(':', impl_->only_field(payload).name.size() + 2);
  if (begin == std::string::npos || text.size() < begin + 2) return std::nullopt;
  const std::size_t first = text.find_first_not_of(' ', begin + 1);
  return text.substr(first, text.rfind('}') - first);
}

}  // namespace rtpm::schema
