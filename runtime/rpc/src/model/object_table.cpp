#include "model/object_table.hpp"

#include <algorithm>
#include <array>
#include <span>
#include <utility>

#include "rtpm/wire/control.hpp"
#include "rtpm/wire/limits.hpp"
#include "rtpm/wire/url.hpp"

namespace rtpm::rpc {
namespace {

std::vector<Role> roles_by_number(const InterfaceDescriptor& interface) {
  std::vector<Role> roles;
  for (const MethodDescriptor& method : interface.methods) {
    if (method.id >= roles.size()) roles.resize(method.id + std::size_t{1}, Role::kCommand);
    roles[method.id] = method.role;
  }
  return roles;
}

}  // namespace

bool admits(const ObjectOptions& options, Priority priority) noexcept {
  if (options.model == PriorityModel::kServerDeclared) priority = options.priority;
  return options.bands.empty() ||
         std::ranges::any_of(options.bands, [&](Band band) { return band.contains(priority); });
}

expected<void, SetupError> ObjectTable::add(std::string_view path, Servant& servant,
                                            ObjectOptions options, Priority ceiling) {
  const std::string name(path);
  if (!wire::is_valid_path(path)) {
    return setup_error("object path '" + name + "' is malformed", "",
                       "1 to 200 letters, digits, '.', '_', '-', in components parted by single "
                       "slashes, such as lab/arm0");
  }
  if (objects_.size() == kObjectCountMax) {
    return setup_error("object '" + name + "' is one too many for this server (limit " +
                           std::to_string(kObjectCountMax) + ")",
                       "", "serve it from another");
  }
  if (std::ranges::any_of(objects_, [&](const Object& object) { return object.path == path; })) {
    return setup_error("object path '" + name + "' is in use on this server", "",
                       "give each object a path of its own");
  }
  if (options.priority > ceiling) {
    return setup_error("object '" + name + "' declares priority " +
                           std::to_string(options.priority.value()) +
                           " above the server's ceiling " + std::to_string(ceiling.value()),
                       "", "declare a lower one or raise ServerConfig::ceiling");
  }
  objects_.push_back({name, &servant, std::move(options),
                      static_cast<std::uint32_t>(objects_.size()) + 1,
                      roles_by_number(servant.interface())});
  return {};
}

const Object* ObjectTable::find(std::uint32_t service) const noexcept {
  // Number 0 is the session itself.
  if (service == wire::kSessionService || service > objects_.size()) return nullptr;
  return &objects_[service - 1];
}

const Object* ObjectTable::find(std::string_view path) const noexcept {
  const auto found = std::ranges::find(objects_, path, &Object::path);
  return found == objects_.end() ? nullptr : &*found;
}

namespace {

// Writes as many methods as fit the frame: the client compares them with its interface.
std::uint32_t write_bind_reply(std::uint32_t service, const Object& object,
                               MutableBytes to) noexcept {
  const InterfaceDescriptor& interface = object.servant->interface();
  const std::size_t room = (to.size() - wire::BindReply::kSize) / wire::MethodEntry::kSize;
  const std::size_t count = std::min({room, interface.methods.size(), std::size_t{0xffff}});
  wire::BindReply reply;
  reply.service = service;
  reply.is_server_declared = object.options.model == PriorityModel::kServerDeclared;
  reply.priority = object.options.priority;
  reply.fingerprint = interface.fingerprint;
  reply.method_count = static_cast<std::uint16_t>(count);
  reply.is_method_list_complete = count == interface.methods.size();
  encode(reply, to);
  std::size_t at = wire::BindReply::kSize;
  for (const MethodDescriptor& method : interface.methods.first(count)) {
    encode(wire::MethodEntry{method.id, method.fingerprint}, to.subspan(at));
    at += wire::MethodEntry::kSize;
  }
  return static_cast<std::uint32_t>(at);
}

// hp-6.4-2
bool is_shown(const ObjectView* view, const Object& object) noexcept {
  return view == nullptr || view->shows(object);
}

// Writes the paths most similar to one that does not exist.
std::uint32_t write_similar_paths(std::span<const Object> objects, std::string_view path,
                                  MutableBytes to, const ObjectView* view) noexcept {
  struct Candidate {
    const Object* object = nullptr;
    std::size_t similarity = 0;
  };
  std::array<Candidate, wire::kSimilarPathCountMax> best{};
  for (const Object& object : objects) {
    if (!is_shown(view, object)) continue;
    Candidate next{&object, wire::similarity(object.path, path)};
    // The list is sorted: less similar paths move down, and the least similar one drops out.
    for (Candidate& candidate : best) {
      if (candidate.object == nullptr || next.similarity > candidate.similarity) {
        std::swap(candidate, next);
      }
      if (next.object == nullptr) break;
    }
  }
  std::size_t size = 0;
  for (const Candidate& candidate : best) {
    if (candidate.object == nullptr) break;
    ByteWriter writer(to.subspan(size));
    writer.put_text(candidate.object->path);
    if (!writer.ok()) break;
    size += writer.size();
  }
  return static_cast<std::uint32_t>(size);
}

}  // namespace

std::vector<std::string> ObjectTable::paths() const {
  std::vector<std::string> paths;
  for (const Object& object : objects_)
    paths.push_back(object.path);
  return paths;
}

DispatchResult ObjectTable::bind(ConstBytes request, MutableBytes reply,
                                 const ObjectView* view) const noexcept {
  const auto wanted = wire::decode_bind_request(request);
  if (!wanted) return {wire::Status::kBadRequest, 0};
  const Object* const found = find(wanted->path);
  if (found == nullptr || !is_shown(view, *found)) {
    return {wire::Status::kNoSuchObject, write_similar_paths(objects_, wanted->path, reply, view)};
  }
  const std::string_view name = found->servant->interface().name;
  if (name != wanted->interface) {
    // The payload names the object's interface, so that the client can show it.
    ByteWriter writer(reply);
    writer.put_text(name);
    return {wire::Status::kWrongInterface,
            static_cast<std::uint32_t>(writer.ok() ? writer.size() : 0)};
  }
  return {wire::Status::kOk, write_bind_reply(found->number, *found, reply)};
}

// hp-6.3-1
DispatchResult ObjectTable::describe(ConstBytes request, MutableBytes reply,
                                     const ObjectView* view) const noexcept {
  const auto service = wire::decode_describe_request(request);
  if (!service) return {wire::Status::kBadRequest, 0};
  const Object* const object = find(*service);
  if (object == nullptr || !is_shown(view, *object)) return {wire::Status::kNoSuchObject, 0};
  const std::string_view text = object->servant->interface().text;
  if (text.empty()) return {wire::Status::kNoSuchMethod, 0};
  if (text.size() > reply.size()) return {wire::Status::kTooLarge, 0};
  std::ranges::copy(std::as_bytes(std::span(text)), reply.begin());
  return {wire::Status::kOk, static_cast<std::uint32_t>(text.size())};
}

}  // namespace rtpm::rpc
