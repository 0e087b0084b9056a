#include "parameters/parameter_desk.hpp"

#include <algorithm>
#include <utility>
#include <variant>

namespace rtpm::console {
namespace {

constexpr Duration kBindDeadline = std::chrono::milliseconds{500};

std::vector<NumericParameter> numbers_of(const gvd::DeviceConfiguration& configuration) {
  std::vector<NumericParameter> numbers;
  const auto add = [&](const gvd::Parameter& parameter, const std::string& name, double value) {
    numbers.push_back({name, parameter.spec.unit, value});
  };
  for (const gvd::Parameter& parameter : configuration.parameters) {
    const std::string& name = parameter.spec.name;
    if (const auto* const flag = std::get_if<bool>(&parameter.value)) {
      add(parameter, name, *flag ? 1 : 0);
    } else if (const auto* const whole = std::get_if<std::int64_t>(&parameter.value)) {
      add(parameter, name, static_cast<double>(*whole));
    } else if (const auto* const real = std::get_if<double>(&parameter.value)) {
      add(parameter, name, *real);
    } else if (const auto* const vector = std::get_if<std::vector<double>>(&parameter.value)) {
      for (std::size_t i = 0; i < vector->size(); ++i)
        add(parameter, name + "[" + std::to_string(i) + "]", (*vector)[i]);
    }
  }
  return numbers;
}

}  // namespace

struct ParameterDesk::Gathering {
  std::uint64_t connection_id = 0;
  std::optional<std::string> id{};
  std::set<std::string> names{};  ///< The requested names; if empty, all.
  bool answers = true;            ///< A change without an id is not answered.
  std::size_t left_count = 0;
  std::vector<foxglove::ParameterInfo> parameters{};
};

ParameterDesk::ParameterDesk(
    rpc::Node& node, Clients& clients, WorkerPool& pool, WorkerPool& background, Post post,
    std::function<void(const std::string&, const std::vector<NumericParameter>&)> on_numbers)
    : node_(node),
      clients_(clients),
      pool_(pool),
      background_(background),
      post_(std::move(post)),
      on_numbers_(std::move(on_numbers)) {}

void ParameterDesk::set_objects(std::vector<std::string> names) {
  names_ = std::move(names);
  std::erase_if(links_, [&](const auto& one) { return !has(one.first); });
  for (const std::string& name : names_) {
    auto& link = links_[name];
    if (!link) link = std::make_shared<Link>();
  }
}

bool ParameterDesk::has(const std::string& object) const {
  return std::ranges::count(names_, object) > 0;
}

expected<gvd::DeviceConfiguration, std::string> ParameterDesk::read(const std::string& object,
                                                                    Link& link) {
  if (!link.client) {
    gvd::ConfigurationClientOptions options;
    options.bind.deadline = kBindDeadline;
    auto client = gvd::ConfigurationClient::open(node_, object, options);
    if (!client) return unexpected{object + ": " + client.error().reason()};
    link.client.emplace(std::move(*client));
  }
  auto configuration = link.client->list();
  if (!configuration) return unexpected{object + ": " + configuration.error().words.reason()};
  return std::move(*configuration);
}

ParameterDesk::Found ParameterDesk::list(const std::string& object, Link& link) {
  const std::lock_guard lock(link.mutex);
  const auto configuration = read(object, link);
  if (!configuration) return {{}, configuration.error(), {}};
  std::vector<driver::ParameterSetting> settings;
  for (const gvd::Parameter& parameter : configuration->parameters)
    settings.push_back({parameter.spec.name, parameter.value});
  return {infos_of(object, settings), {}, numbers_of(*configuration)};
}

ParameterDesk::Found ParameterDesk::apply(
    const std::string& object, Link& link,
    const std::vector<foxglove::ParameterRequest>& parameters) {
  const std::lock_guard lock(link.mutex);
  const auto configuration = read(object, link);
  if (!configuration) return {{}, configuration.error(), {}};
  std::string problem;
  std::vector<driver::ParameterSetting> settings;
  for (const foxglove::ParameterRequest& request : parameters) {
    const std::string name = request.name.substr(object.size() + 1);
    const gvd::Parameter* const parameter = configuration->find(name);
    if (parameter == nullptr) {
      problem = object + ": there is no parameter '" + name + "'";
      break;
    }
    auto value = value_of(*parameter, request.value);
    if (!value) {
      problem = object + ": " + value.error();
      break;
    }
    settings.push_back({name, std::move(*value)});
  }
  if (problem.empty()) {
    const auto applied = link.client->apply(configuration->revision, settings);
    if (!applied) problem = object + ": " + applied.error().words.text();
  }
  // Reads the device's current values, whether or not the change succeeded.
  std::vector<std::string> names;
  for (const foxglove::ParameterRequest& request : parameters) {
    const std::string name = request.name.substr(object.size() + 1);
    if (configuration->find(name) != nullptr) names.push_back(name);
  }
  if (names.empty()) return {{}, problem, {}};
  const auto values = link.client->get(names);
  return {values ? infos_of(object, values->settings) : std::vector<foxglove::ParameterInfo>{},
          problem,
          {}};
}

void ParameterDesk::end(const std::shared_ptr<Gathering>& gathering, Found found) {
  if (!found.problem.empty()) {
    clients_.send_status(gathering->connection_id, foxglove::StatusLevel::kError, found.problem);
  }
  publish(found.parameters);
  for (foxglove::ParameterInfo& info : found.parameters) {
    const bool is_wanted = gathering->names.empty() || gathering->names.contains(info.name);
    if (is_wanted) gathering->parameters.push_back(std::move(info));
  }
  if (--gathering->left_count > 0) return;
  if (Client* const client = clients_.find(gathering->connection_id)) --client->open_call_count;
  if (!gathering->answers) return;
  clients_.send(gathering->connection_id,
                foxglove::parameter_values(gathering->parameters, gathering->id));
}

void ParameterDesk::get(Client& client, const foxglove::GetParameters& request) {
  const std::uint64_t id = client.connection->id();
  std::set<std::string> objects;
  for (const std::string& name : request.names) {
    const ParameterName split = split_name(name, names_);
    // The protocol omits parameters that do not exist.
    if (!split.object.empty()) objects.insert(split.object);
  }
  if (request.names.empty()) objects = {names_.begin(), names_.end()};
  if (objects.empty()) return clients_.send(id, foxglove::parameter_values({}, request.id));
  auto gathering = std::make_shared<Gathering>();
  gathering->connection_id = id;
  gathering->id = request.id;
  gathering->names = {request.names.begin(), request.names.end()};
  gathering->left_count = objects.size();
  ++client.open_call_count;
  WorkerPool& pool = client.connection->may_command() ? pool_ : background_;
  for (const std::string& object : objects) {
    const bool is_queued = pool.run("config " + object, [=, this, link = links_[object]] {
      post_([=, this, found = list(object, *link)] { end(gathering, found); });
    });
    if (!is_queued) end(gathering, {{}, object + ": too much waits to be done", {}});
  }
}

void ParameterDesk::set(Client& client, const foxglove::SetParameters& request) {
  const std::uint64_t id = client.connection->id();
  if (!client.connection->may_command()) {
    clients_.send_status(id, foxglove::StatusLevel::kError, client.connection->refusal());
    std::vector<std::string> names;
    for (const foxglove::ParameterRequest& one : request.parameters)
      names.push_back(one.name);
    if (Client* const still_there = clients_.find(id); still_there != nullptr && !names.empty()) {
      get(*still_there, {names, request.id});
    }
    return;
  }
  std::map<std::string, std::vector<foxglove::ParameterRequest>> by_object;
  for (const foxglove::ParameterRequest& one : request.parameters) {
    const ParameterName split = split_name(one.name, names_);
    if (split.object.empty()) {
      clients_.send_status(id, foxglove::StatusLevel::kError,
                           "there is no parameter '" + one.name + "'");
    } else {
      by_object[split.object].push_back(one);
    }
  }
  Client* const still_there = clients_.find(id);
  if (still_there == nullptr) return;
  if (by_object.empty()) {
    if (request.id) clients_.send(id, foxglove::parameter_values({}, request.id));
    return;
  }
  auto gathering = std::make_shared<Gathering>();
  gathering->connection_id = id;
  gathering->id = request.id;
  gathering->left_count = by_object.size();
  ++still_there->open_call_count;
  for (const auto& [object, parameters] : by_object) {
    const bool is_queued = pool_.run(
        "config " + object,
        [=, this, object = object, parameters = parameters, link = links_[object]] {
          post_([=, this, found = apply(object, *link, parameters)] { end(gathering, found); });
        });
    if (!is_queued) end(gathering, {{}, object + ": too much waits to be done", {}});
  }
}

void ParameterDesk::watch(Client& client, const foxglove::WatchParameters& request) {
  if (request.names.empty()) {
    client.watches_all_parameters = request.is_watching;
    if (!request.is_watching) client.watched_parameters.clear();
    return;
  }
  for (const std::string& name : request.names) {
    if (!request.is_watching) {
      client.watched_parameters.erase(name);
    } else if (client.watched_parameters.size() < foxglove::kListSizeMax) {
      client.watched_parameters.insert(name);
    }
  }
}

void ParameterDesk::publish(const std::vector<foxglove::ParameterInfo>& parameters) {
  std::vector<foxglove::ParameterInfo> changed;
  for (const foxglove::ParameterInfo& info : parameters) {
    const auto known = published_.find(info.name);
    const bool is_new = known == published_.end();
    if (!is_new && known->second == info.value) continue;
    published_[info.name] = info.value;
    // A parameter seen for the first time has not changed.
    if (!is_new) changed.push_back(info);
  }
  if (changed.empty()) return;
  clients_.for_each([&](Client& client) {
    std::vector<foxglove::ParameterInfo> wanted;
    for (const foxglove::ParameterInfo& info : changed) {
      if (client.watches(info.name)) wanted.push_back(info);
    }
    if (wanted.empty()) return;
    client.connection->send_text(
        std::make_shared<const std::string>(foxglove::parameter_values(wanted, std::nullopt)));
  });
}

void ParameterDesk::on_change(const std::string& object) {
  const auto link = links_.find(object);
  if (link == links_.end()) return;
  // A server that does not answer gets one request at a time, however many changes are suspected.
  if (link->second->is_asked) {
    link->second->is_outdated = true;
    return;
  }
  link->second->is_asked = background_.run("config " + object, [this, object, link = link->second] {
    post_([this, object, link, found = list(object, *link)] {
      link->is_asked = false;
      publish(found.parameters);
      on_numbers_(object, found.numbers);
      if (std::exchange(link->is_outdated, false)) on_change(object);
    });
  });
}

void ParameterDesk::poll() {
  for (const std::string& name : names_)
    on_change(name);
}

}  // namespace rtpm::console
