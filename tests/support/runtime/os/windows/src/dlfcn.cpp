#include <dlfcn.h>
#include <windows.h>

void* dlopen(const char* file, int) {
  return LoadLibraryA(file);
}
void* dlsym(void* library, const char* name) {
  return reinterpret_cast<void*>(GetProcAddress(static_cast<HMODULE>(library), name));
}
int dlclose(void* library) {
  return FreeLibrary(static_cast<HMODULE>(library)) != 0 ? 0 : -1;
}
const char* dlerror() {
  return "the library can't be loaded";
}
