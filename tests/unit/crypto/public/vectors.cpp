#include "vectors.hpp"

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

namespace rtpm::crypto::test {
namespace {

using Json = nlohmann::json;

std::optional<std::ifstream> open_file(const std::string& path) {
  std::ifstream file(path);
  if (!file) return std::nullopt;
  return file;
}

std::optional<Json> read_json(const std::string& name) {
  const char* const folder = std::getenv("RTPM_PUBLIC_VECTORS");
  auto file = open_file(std::string(folder != nullptr ? folder : RTPM_PUBLIC_VECTORS) + "/" + name);
  if (!file) return std::nullopt;
  return Json::parse(*file);
}

Bytes bytes_at(const Json& from, const char* name) {
  return bytes_of_hex(from.at(name).get<std::string>());
}

std::optional<Bytes> bytes_if(const Json& from, const char* name) {
  if (!from.contains(name)) return std::nullopt;
  return bytes_at(from, name);
}

NoiseVector noise_vector(const Json& from) {
  NoiseVector vector;
  vector.protocol_name = from.at("protocol_name").get<std::string>();
  vector.prologue = bytes_at(from, "init_prologue");
  vector.initiator_static = bytes_if(from, "init_static");
  vector.initiator_ephemeral = bytes_if(from, "init_ephemeral");
  vector.responder_static = bytes_if(from, "resp_static");
  vector.responder_ephemeral = bytes_if(from, "resp_ephemeral");
  for (const Json& key : from.value("init_psks", Json::array())) {
    vector.preshared.push_back(bytes_of_hex(key.get<std::string>()));
  }
  vector.handshake_hash = bytes_at(from, "handshake_hash");
  for (const Json& message : from.at("messages")) {
    vector.messages.push_back({bytes_at(message, "payload"), bytes_at(message, "ciphertext")});
  }
  return vector;
}

// A line "name=value" of a vector of flynn/noise.
void take_line(NoiseVector& vector, const std::string& name, const Bytes& value) {
  if (name == "prologue") vector.prologue = value;
  if (name == "init_static") vector.initiator_static = value;
  if (name == "gen_init_ephemeral") vector.initiator_ephemeral = value;
  if (name == "resp_static") vector.responder_static = value;
  if (name == "gen_resp_ephemeral") vector.responder_ephemeral = value;
  if (name == "preshared_key") vector.preshared.push_back(value);
  if (name.ends_with("_payload")) vector.messages.push_back({value, {}});
  if (name.ends_with("_ciphertext")) vector.messages.back().ciphertext = value;
}

}  // namespace

Bytes bytes_of_hex(const std::string& hex) {
  Bytes bytes(hex.size() / 2);
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    bytes[i] = static_cast<std::byte>(std::stoi(hex.substr(2 * i, 2), nullptr, 16));
  }
  return bytes;
}

std::optional<std::vector<NoiseVector>> read_cacophony() {
  const auto json = read_json("cacophony.txt");
  if (!json) return std::nullopt;
  std::vector<NoiseVector> vectors;
  for (const Json& vector : json->at("vectors"))
    vectors.push_back(noise_vector(vector));
  return vectors;
}

std::optional<std::vector<NoiseVector>> read_flynn() {
  auto file = open_file("/usr/share/gocode/src/github.com/flynn/noise/vectors.txt");
  if (!file) return std::nullopt;
  std::vector<NoiseVector> vectors;
  for (std::string line; std::getline(*file, line);) {
    const std::size_t equals = line.find('=');
    if (equals == std::string::npos) continue;
    const std::string name = line.substr(0, equals);
    const std::string value = line.substr(equals + 1);
    if (name == "handshake") {
      vectors.emplace_back();
      vectors.back().protocol_name = value;
      vectors.back().initiator_begins_transport = true;
    } else {
      take_line(vectors.back(), name, bytes_of_hex(value));
    }
  }
  return vectors;
}

std::optional<std::vector<KeyAgreementVector>> read_key_agreement() {
  const auto json = read_json("x25519_test.json");
  if (!json) return std::nullopt;
  std::vector<KeyAgreementVector> vectors;
  for (const Json& group : json->at("testGroups")) {
    for (const Json& test : group.at("tests")) {
      vectors.push_back({test.at("tcId").get<int>(), bytes_at(test, "public"),
                         bytes_at(test, "private"), bytes_at(test, "shared")});
    }
  }
  return vectors;
}

std::optional<std::vector<SealVector>> read_seals(const std::string& file) {
  const auto json = read_json(file);
  if (!json) return std::nullopt;
  std::vector<SealVector> vectors;
  for (const Json& group : json->at("testGroups")) {
    for (const Json& test : group.at("tests")) {
      vectors.push_back({test.at("tcId").get<int>(), test.at("result") == "valid",
                         group.at("keySize").get<std::size_t>(),
                         group.at("ivSize").get<std::size_t>(), bytes_at(test, "key"),
                         bytes_at(test, "iv"), bytes_at(test, "aad"), bytes_at(test, "msg"),
                         bytes_at(test, "ct"), bytes_at(test, "tag")});
    }
  }
  return vectors;
}

}  // namespace rtpm::crypto::test
