// A device from C#, through the C interface: prints positions, as a script in Unity would read them.
//   mcs Position.cs && LD_LIBRARY_PATH=FOLDER-OF-librtpm-c mono Position.exe lab/arm0 5
using System;
using System.Runtime.InteropServices;
using System.Threading;

static class Rtpm
{
    const string Library = "rtpm-c.so.0";

    [StructLayout(LayoutKind.Sequential)]
    public struct Sample
    {
        public uint StructSize;
        public uint Buttons;
        public ulong Sequence;
        public long HostTimeNs;
        [MarshalAs(UnmanagedType.ByValArray, SizeConst = 3)] public double[] PositionM;
        [MarshalAs(UnmanagedType.ByValArray, SizeConst = 4)] public double[] Orientation;
        [MarshalAs(UnmanagedType.ByValArray, SizeConst = 3)] public double[] LinearMPerS;
        [MarshalAs(UnmanagedType.ByValArray, SizeConst = 3)] public double[] AngularRadPerS;
        [MarshalAs(UnmanagedType.ByValArray, SizeConst = 3)] public double[] ForceNewton;
        // Further fields may be left out: struct_size says where this one ends.
    }

    [DllImport(Library)] public static extern IntPtr rtpm_last_error();
    [DllImport(Library)] public static extern int rtpm_node_open(IntPtr options, out IntPtr node);
    [DllImport(Library)] public static extern void rtpm_node_close(IntPtr node);
    [DllImport(Library)]
    public static extern int rtpm_device_open(IntPtr node, string name, IntPtr options, out IntPtr device);
    [DllImport(Library)] public static extern void rtpm_device_close(IntPtr device);
    [DllImport(Library)] public static extern int rtpm_device_read(IntPtr device, ref Sample sample);

    public static void Check(int status)
    {
        if (status != 0) throw new Exception(Marshal.PtrToStringAnsi(rtpm_last_error()));
    }
}

static class Position
{
    static void Main(string[] arguments)
    {
        IntPtr node, device;
        Rtpm.Check(Rtpm.rtpm_node_open(IntPtr.Zero, out node));
        Rtpm.Check(Rtpm.rtpm_device_open(node, arguments[0], IntPtr.Zero, out device));
        for (int i = 0; i < int.Parse(arguments[1]); ++i)
        {
            var sample = new Rtpm.Sample { StructSize = (uint)Marshal.SizeOf(typeof(Rtpm.Sample)) };
            // A reading has 10 ms, which a garbage collection may take for itself.
            if (Rtpm.rtpm_device_read(device, ref sample) == 0)
                Console.WriteLine("sample {0}: {1:F4} {2:F4} {3:F4} m", sample.Sequence,
                    sample.PositionM[0], sample.PositionM[1], sample.PositionM[2]);
            Thread.Sleep(20);
        }
        Rtpm.rtpm_device_close(device);
        Rtpm.rtpm_node_close(node);
    }
}
