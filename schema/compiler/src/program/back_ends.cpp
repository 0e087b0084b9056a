#include <array>

#include "rtpm/schema/back_end.hpp"

namespace rtpm::schema {

std::span<const BackEndEntry> back_ends() noexcept {
  static constexpr std::array kBackEnds{
      BackEndEntry{"cpp", "C++20 stubs and skeletons: NAME.rtpm.hpp, NAME.rtpm.cpp",
                   &make_cpp_back_end},
      BackEndEntry{"java",
                   "Java 17 for the module org.rtpm: a file per class in folders of packages",
                   &make_java_back_end},
      BackEndEntry{"json", "the model of the schema, for other generators: NAME.rtpm.json",
                   &make_json_back_end},
      BackEndEntry{"python", "for Python's package rtpm: NAME_rtpm.py, types in NAME_rtpm.pyi",
                   &make_python_back_end},
      BackEndEntry{"typescript", "an ES module for the package rtpm: NAME.rtpm.ts",
                   &make_typescript_back_end},
  };
  return kBackEnds;
}

}  // namespace rtpm::schema
