import com.sun.management.ThreadMXBean;
import java.io.IOException;
import java.lang.management.ManagementFactory;
import java.nio.ByteBuffer;
import java.nio.ByteOrder;
import java.nio.file.DirectoryStream;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.ArrayList;
import java.util.Arrays;
import java.util.Collections;
import java.util.List;
import java.util.Map;
import java.util.Random;
import java.util.TreeMap;
import java.util.concurrent.CompletableFuture;
import java.util.concurrent.CompletionStage;
import java.util.concurrent.Flow;
import lab.native_.*;
import org.rtpm.values.BadValue;
import org.rtpm.values.CallContext;
import org.rtpm.values.Codec;
import org.rtpm.values.Kind;
import org.rtpm.values.Operation;
import org.rtpm.values.TableCodec;

/** Gives the payloads in a folder back, as decoded and encoded again: ExchangeValues FOLDER. */
final class ExchangeValues {
  private static final Map<String, Codec<?>> CODECS =
      Map.of(
          "Scalars", Scalars_.CODEC,
          "Optionals", Optionals.CODEC,
          "Vectors", Vectors.CODEC,
          "Tree", Tree.CODEC,
          "Required", Required.CODEC,
          "Bare", Packed.CODEC,
          "Ranged", Ranged.CODEC,
          "Happened", Happened.CODEC);

  private ExchangeValues() {}

  public static void main(String[] arguments) throws IOException {
    Map<Path, byte[]> payloads = new TreeMap<>();
    try (DirectoryStream<Path> files = Files.newDirectoryStream(Path.of(arguments[0]), "*.cpp")) {
      for (Path file : files) {
        payloads.put(file, Files.readAllBytes(file));
      }
    }
    check(payloads.size() > 15, "there are payloads");
    for (Map.Entry<Path, byte[]> payload : payloads.entrySet()) {
      String name = payload.getKey().toString();
      Path answer = Path.of(name.substring(0, name.length() - 3) + "java");
      Files.write(answer, giveBack(codecOf(payload.getKey()), payload.getValue()));
    }
    checkFields(payloads);
    checkRefusals();
    checkTexts();
    checkViews();
    checkMethods();
    long count = fuzz(payloads);
    System.out.println(payloads.size() + " payloads, " + count + " hostile ones");
  }

  private static Codec<?> codecOf(Path file) {
    return CODECS.get(file.getFileName().toString().split("\\.")[1]);
  }

  private static <T> byte[] giveBack(Codec<T> codec, byte[] bytes) {
    T value = codec.decode(ByteBuffer.wrap(bytes));
    byte[] encoded = codec.encode(value);
    T again = codec.decode(ByteBuffer.wrap(encoded));
    check(value.equals(again), value + " became " + again);
    check(value.hashCode() == again.hashCode(), "equal values have equal hashes");
    return encoded;
  }

  /** A swap of two fields would not show in what is given back. */
  private static void checkFields(Map<Path, byte[]> payloads) {
    for (Map.Entry<Path, byte[]> payload : payloads.entrySet()) {
      if (payload.getKey().toString().endsWith("Bare.cpp")) {
        checkPacked(Packed.CODEC.decode(ByteBuffer.wrap(payload.getValue())));
      }
    }
    Scalars_ absent = Scalars_.builder().build();
    check(absent.a() == -3 && absent.b() == 255 && absent.f() == 4294967295L, "defaults");
    check(absent.h() == -1 && absent.m().equals(Mode.HOLD) && absent.k(), "defaults");
    check(absent.n().has(Axes.LAST) && !absent.n().has(Axes.Y), "flags");
    check(new Mode(77).toString().equals("77") && Mode.CLASS.toString().equals("class"), "names");
    Scalars_ again = Scalars_.CODEC.decode(ByteBuffer.wrap(encode(absent)));
    check(absent.equals(again), "defaults are kept");
    byte[] text = Leaf.CODEC.encode(Leaf.builder().string_("x").slot3(7).build());
    check(Leaf.CODEC.decode(ByteBuffer.wrap(text)).slot3() == 7, "a field by its name");
  }

  private static void checkPacked(Packed packed) {
    check(packed.at() == -1 && packed.bytes() == 255 && packed.value() == 4294967295L, "numbers");
    check(packed.wrap().equals(new Vec(1, 2, 3)), "a struct");
    check(packed.modes().equals(List.of(Mode.FREE, Mode.CLASS, new Mode(9))), "enums");
    check(packed.vecs().get(1).equals(new Vec(7, 8, 9)), "structs");
    check(Arrays.equals(packed.flags(), new boolean[] {true, false, true}), "bools");
    check(packed.axes().equals(Axes.LAST.or(Axes.X)), "flags");
    check(Arrays.equals(packed.u16s(), new int[] {1, 65535}), "unsigned numbers");
    check(packed.u64() == -1 && packed.getClass_() == -3 && packed.lab_() == -4, "names");
    check(packed.reals()[1] == -0.25f && packed.isOn(), "the last fields");
  }

  private static void checkViews() {
    ByteBuffer buffer = ByteBuffer.allocate(256).order(ByteOrder.LITTLE_ENDIAN);
    Vec.View view = new Vec.View().wrap(buffer, 24);
    view.x(1.5).y(-2).build(3);
    check(view.toRecord().equals(new Vec(1.5, -2, 3)), "a view writes");
    check(buffer.getDouble(24) == 1.5 && buffer.get(23) == 0, "at its place");
    Packed.View packed = new Packed.View().wrap(buffer, 0);
    packed.u16s(1, 65535).modes(2, 9);
    packed.vecs(1).set(new Vec(4, 5, 6));
    check(packed.u16s(1) == 65535 && packed.u16s(0) == 0 && packed.modes(2) == 9, "arrays");
    check(packed.toRecord().vecs().get(1).y() == 5, "views within views");
    refuses(IndexOutOfBoundsException.class, () -> packed.u16s(2));
    ThreadMXBean threads = (ThreadMXBean) ManagementFactory.getThreadMXBean();
    long before = threads.getCurrentThreadAllocatedBytes();
    for (int i = 0; i < 10_000; ++i) {
      view.wrap(buffer, 8 * (i % 8)).x(view.x() + i);
      packed.wrap(buffer, 0).vecs(i % 2).y(i);
      packed.modes(i % 3, packed.modes(0)).wrap().build(i);
    }
    long allocated = threads.getCurrentThreadAllocatedBytes() - before;
    check(allocated < 4096, "views make no garbage, but " + allocated + " bytes");
    refuses(IndexOutOfBoundsException.class, () -> new Vec.View().wrap(buffer, 233));
    refuses(
        IllegalArgumentException.class, () -> new Vec.View().wrap(ByteBuffer.allocate(99), 0));
  }

  private static void checkRefusals() {
    refuses(BadValue.class, () -> encode(Scalars_.builder().a(128).build()));
    refuses(BadValue.class, () -> encode(Scalars_.builder().b(-1).build()));
    refuses(BadValue.class, () -> encode(Scalars_.builder().f(1L << 32).build()));
    refuses(BadValue.class, () -> Tree.CODEC.encode(Tree.builder().build()));
    refuses(BadValue.class, () -> Tree.CODEC.encode(Tree.builder().name("\ud800").build()));
    refuses(
        BadValue.class,
        () -> Tree.CODEC.encode(Tree.builder().name("").any(new Any.Unknown(9)).build()));
    Tree tree = Tree.builder().name("leaf").build();
    for (int i = 0; i < 70; ++i) {
      tree = Tree.builder().name("branch").left(tree).build();
    }
    Tree deep = tree;
    refuses(BadValue.class, () -> Tree.CODEC.encode(deep));
    byte[] deepBytes =
        new TableCodec<Tree>("deep", 99, (reader, at) -> null, Tree.CODEC::write).encode(deep);
    refuses(BadValue.class, () -> Tree.CODEC.decode(ByteBuffer.wrap(deepBytes)));
    byte[] crooked = encode(Scalars_.builder().e(5).build());
    int vtable = crooked[0] - crooked[crooked[0]];
    crooked[vtable + 4 + 2 * 4] += 1;
    refuses(BadValue.class, () -> Scalars_.CODEC.decode(ByteBuffer.wrap(crooked)));
    refuses(BadValue.class, () -> Vec.CODEC.decode(ByteBuffer.allocate(23)));
    refuses(BadValue.class, () -> Vectors.CODEC.decode(ByteBuffer.wrap(sharedText())));
    refuses(BadValue.class, () -> Tree.CODEC.decode(ByteBuffer.allocate(0)));
  }

  /** A message of 150 kB whose 20000 offsets lead to one text of 64 KiB: 1.3 GB when decoded. */
  private static byte[] sharedText() {
    List<String> texts = new ArrayList<>(Collections.nCopies(20000, ""));
    texts.set(0, "x".repeat(65536));
    byte[] encoded = Vectors.CODEC.encode(Vectors.builder().p(texts).build());
    ByteBuffer bytes = ByteBuffer.wrap(encoded).order(ByteOrder.LITTLE_ENDIAN);
    int table = bytes.getInt(0);
    int slot = table + bytes.getShort(table - bytes.getInt(table) + 4 + 2 * 14);
    int first = slot + bytes.getInt(slot) + 4;
    int text = first + bytes.getInt(first);
    for (int at = first; at < first + 4 * texts.size(); at += 4) {
      bytes.putInt(at, text - at);
    }
    return encoded;
  }

  private static byte[] encode(Scalars_ value) {
    return Scalars_.CODEC.encode(value);
  }

  private static void checkMethods() {
    check(MethodMethods.CALLER.deadline().toNanos() == 1_500_000, "a deadline");
    check(MethodMethods.INTERFACE_.kind() == Kind.ONEWAY, "a oneway");
    check(MethodMethods.SKELETON.kind() == Kind.RECEIPT, "a oneway with receipt");
    check(MethodMethods.INTERFACE.name().equals("lab.native.Method"), "the interface's name");
    check(MethodMethods.INTERFACE.text().startsWith("service lab.native.Method\n"), "its text");
    check(MethodMethods.INTERFACE.schema().contains("\\u0041, */ the end"), "its schema");
    check(MethodMethods.INTERFACE.schema().contains("25 \u00b0C"), "its schema");
    check(Happened.EVENT.type() == 77 && Happened.EVENT.fields().size() == 5, "an event");
    check(operation(4) instanceof Operation.Deferred, "a deferred method");
    check(operation(3) instanceof Operation.Stream, "a stream");
    Codec<Ranged> request = MethodMethods.CONSTRUCTOR.request();
    byte[] good = request.encode(Ranged.builder().b(-8446744073709551616L).build());
    request.decode(ByteBuffer.wrap(good));
    for (Ranged bad :
        List.of(
            Ranged.builder().a(new byte[] {(byte) 201}).build(),
            Ranged.builder().b(-1).build(),
            Ranged.builder().c(2).build(),
            Ranged.builder().e(Float.NaN).build(),
            Ranged.builder().tree(List.of(Ranged.builder().e(3).build())).build(),
            Ranged.builder().any(new RangedAny.Ranged(Ranged.builder().c(-2).build())).build())) {
      byte[] bytes = request.encode(bad);
      refuses(BadValue.class, () -> request.decode(ByteBuffer.wrap(bytes)));
      check(Ranged.CODEC.decode(ByteBuffer.wrap(bytes)).equals(bad), "replies are not checked");
    }
  }

  private static Operation<?, ?> operation(long id) {
    return new Servant().skeleton().operation(id).orElseThrow();
  }

  /** A required text that is absent, not UTF-8, or without a zero behind it. */
  private static void checkTexts() {
    byte[] good = Tree.CODEC.encode(Tree.builder().name("ab").build());
    int name = good.length - 7;
    check(good[name] == 2 && good[name + 4] == 'a' && good[name + 6] == 0, "a text at the end");
    for (byte[] wrong : List.of(new byte[] {(byte) 0xc3, 'x'}, new byte[] {(byte) 0xff, 'x'})) {
      byte[] bytes = good.clone();
      System.arraycopy(wrong, 0, bytes, name + 4, 2);
      refuses(BadValue.class, () -> Tree.CODEC.decode(ByteBuffer.wrap(bytes)));
    }
    byte[] open = good.clone();
    open[name + 6] = 'c';
    refuses(BadValue.class, () -> Tree.CODEC.decode(ByteBuffer.wrap(open)));
    byte[] absent = Leaf.CODEC.encode(Leaf.builder().build());
    refuses(BadValue.class, () -> Tree.CODEC.decode(ByteBuffer.wrap(absent)));
  }

  /** Each payload with some wrong bytes, a wrong length or a wrong offset: decoded, or refused. */
  private static long fuzz(Map<Path, byte[]> payloads) {
    Random random = new Random(46);
    List<Path> files = List.copyOf(payloads.keySet());
    long end = System.nanoTime() + 1_000_000_000L;
    long count = 0;
    while (System.nanoTime() < end) {
      Path file = files.get(random.nextInt(files.size()));
      byte[] bytes = payloads.get(file);
      int size = random.nextInt(8) == 0 ? random.nextInt(bytes.length + 9) : bytes.length;
      bytes = Arrays.copyOf(bytes, size);
      for (int i = random.nextInt(4); i >= 0 && bytes.length > 4; --i) {
        int at = random.nextInt(bytes.length - 3);
        switch (random.nextInt(4)) {
          case 0 -> bytes[at] = (byte) random.nextInt();
          case 1 -> bytes[at] ^= (byte) (1 << random.nextInt(8));
          case 2 -> ByteBuffer.wrap(bytes).putInt(at & ~3, random.nextInt());
          default -> System.arraycopy(bytes, random.nextInt(bytes.length - 3), bytes, at, 4);
        }
      }
      hostile(codecOf(file), bytes);
      ++count;
    }
    return count;
  }

  private static <T> void hostile(Codec<T> codec, byte[] bytes) {
    T value;
    try {
      value = codec.decode(ByteBuffer.wrap(bytes));
    } catch (BadValue expected) {
      return;
    }
    try {
      codec.encode(value);
    } catch (BadValue unknownMember) {
      check(unknownMember.getMessage().contains("unknown"), unknownMember.getMessage());
    }
  }

  private static void refuses(Class<? extends RuntimeException> type, Runnable action) {
    try {
      action.run();
    } catch (RuntimeException refusal) {
      check(type.isInstance(refusal), refusal.toString());
      return;
    }
    check(false, "refused with " + type.getSimpleName());
  }

  private static void check(boolean isTrue, String what) {
    if (!isTrue) {
      throw new AssertionError(what);
    }
  }

  /** Compiles: each method has the type that its schema says. */
  private static final class Servant implements MethodServant {
    @Override
    public Tree wait_(Tree request, CallContext context) {
      return request;
    }

    @Override
    public void toString_(Packed request, CallContext context) {}

    @Override
    public Flow.Publisher<Leaf> delete(CallContext context) {
      return subscriber -> {};
    }

    @Override
    public CompletionStage<Ranged> constructor(Ranged request, CallContext context) {
      return CompletableFuture.completedFuture(request);
    }

    @Override
    public void interface_(CallContext context) {}

    @Override
    public void skeleton_(CallContext context) {}

    @Override
    public Vectors caller(Required request, CallContext context) {
      return Vectors.builder().build();
    }

    @Override
    public void __proto_(CallContext context) {}

    @Override
    public Optionals exchange(Scalars_ request, CallContext context) {
      return Optionals.builder().build();
    }
  }
}
