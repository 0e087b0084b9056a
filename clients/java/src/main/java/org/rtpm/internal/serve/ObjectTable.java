package org.rtpm.internal.serve;

import java.io.ByteArrayOutputStream;
import java.nio.charset.StandardCharsets;
import java.util.Comparator;
import java.util.List;
import java.util.Map;
import java.util.SortedMap;
import java.util.TreeMap;
import java.util.concurrent.ConcurrentHashMap;
import java.util.concurrent.atomic.AtomicInteger;
import java.util.function.Predicate;
import org.rtpm.Status;
import org.rtpm.internal.wire.BindRequest;
import org.rtpm.internal.wire.Bytes;
import org.rtpm.internal.wire.Limits;
import org.rtpm.internal.wire.ServerSessions;
import org.rtpm.values.Interface;
import org.rtpm.values.Skeleton;

/** The objects of a server, and the calls of service 0 about them (hp-6). Threads: any. */
public final class ObjectTable {
  private static final int SIMILAR_COUNT_MAX = 4;
  private static final int CATALOG_SERVICE = Integer.MAX_VALUE;

  private final Map<String, Integer> services = new ConcurrentHashMap<>();
  private final Map<Integer, ServedObject> objects = new ConcurrentHashMap<>();
  private final AtomicInteger lastService = new AtomicInteger();

  /** The answer to a call of service 0. */
  record Answer(Status status, byte[] payload) {
    static Answer refuse(Status status) {
      return new Answer(status, Bytes.NONE);
    }
  }

  /** Adds an object; false if the path is taken. */
  public boolean add(String path, Skeleton skeleton) {
    return add(path, skeleton, lastService.incrementAndGet());
  }

  /** Adds the catalog, whose number is none that a program's object gets. */
  public void addCatalog() {
    add(Catalog.PATH, new Catalog(this).skeleton(), CATALOG_SERVICE);
  }

  private boolean add(String path, Skeleton skeleton, int service) {
    if (services.putIfAbsent(path, service) != null) {
      return false;
    }
    objects.put(service, new ServedObject(path, service, skeleton));
    return true;
  }

  /** Removes an object; calls that run go on. */
  public void remove(String path) {
    Integer service = services.remove(path);
    if (service != null) {
      objects.remove(service);
    }
  }

  /** The interfaces of all objects but the catalog that a caller may see, by path. */
  SortedMap<String, Interface> interfaces(Predicate<String> maySee) {
    SortedMap<String, Interface> found = new TreeMap<>();
    for (ServedObject object : objects.values()) {
      if (!object.path.equals(Catalog.PATH) && maySee.test(object.path)) {
        found.put(object.path, object.skeleton.description());
      }
    }
    return found;
  }

  ServedObject find(int service) {
    return objects.get(service);
  }

  /** Whether an object had this number. */
  boolean wasKnown(int service) {
    return service > 0 && service <= lastService.get();
  }

  Answer ofSession(
      ServerSessions.Request request, int replySizeMax, Predicate<String> maySee) {
    return switch (request.method()) {
      case Limits.METHOD_BIND -> bind(request.payload(), maySee);
      case Limits.METHOD_PING -> new Answer(Status.OK, Bytes.NONE);
      case Limits.METHOD_DESCRIBE -> describe(request.payload(), replySizeMax, maySee);
      default -> Answer.refuse(Status.NO_SUCH_METHOD);
    };
  }

  // hp-6.1-1
  private Answer bind(byte[] payload, Predicate<String> maySee) {
    BindRequest request = BindRequest.read(payload);
    if (request == null) {
      return Answer.refuse(Status.BAD_REQUEST);
    }
    Integer service = services.get(request.path());
    ServedObject object = service == null ? null : objects.get(service);
    // hp-6.4-2
    if (object == null || !maySee.test(object.path)) {
      return new Answer(Status.NO_SUCH_OBJECT, similarPaths(request.path(), maySee));
    }
    String name = object.skeleton.description().name();
    if (!name.equals(request.interfaceName())) {
      return new Answer(Status.WRONG_INTERFACE, texts(List.of(name)));
    }
    return new Answer(Status.OK, object.bindReply);
  }

  private byte[] similarPaths(String path, Predicate<String> maySee) {
    Comparator<String> byLikeness = Comparator.comparingInt(other -> -likeness(path, other));
    return texts(
        services.keySet().stream()
            .filter(other -> likeness(path, other) > 0 && maySee.test(other))
            .sorted(byLikeness.thenComparing(Comparator.naturalOrder()))
            .limit(SIMILAR_COUNT_MAX)
            .toList());
  }

  // How many characters both have in common at their beginnings and ends.
  private static int likeness(String path, String other) {
    int size = Math.min(path.length(), other.length());
    int begin = 0;
    while (begin < size && path.charAt(begin) == other.charAt(begin)) {
      ++begin;
    }
    int end = 0;
    while (end < size - begin
        && path.charAt(path.length() - 1 - end) == other.charAt(other.length() - 1 - end)) {
      ++end;
    }
    return begin + end;
  }

  private static byte[] texts(List<String> all) {
    ByteArrayOutputStream to = new ByteArrayOutputStream();
    for (String text : all) {
      byte[] bytes = text.getBytes(StandardCharsets.UTF_8);
      to.write(bytes.length);
      to.write(bytes.length >> 8);
      to.writeBytes(bytes);
    }
    return to.toByteArray();
  }

  // hp-6.3-1
  private Answer describe(byte[] payload, int replySizeMax, Predicate<String> maySee) {
    if (payload.length != 4) {
      return Answer.refuse(Status.BAD_REQUEST);
    }
    ServedObject object = objects.get(Bytes.i32(payload, 0));
    if (object == null || !maySee.test(object.path)) {
      return Answer.refuse(Status.NO_SUCH_OBJECT);
    }
    String text = object.skeleton.description().text();
    if (text.isEmpty()) {
      return Answer.refuse(Status.NO_SUCH_METHOD);
    }
    byte[] bytes = text.getBytes(StandardCharsets.UTF_8);
    return bytes.length > replySizeMax
        ? Answer.refuse(Status.TOO_LARGE)
        : new Answer(Status.OK, bytes);
  }
}
