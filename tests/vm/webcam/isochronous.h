// Part of webcam.c: an isochronous endpoint, as most webcams have one. Its bandwidth is reserved by alternate settings.

// What a setting sends at most in a microframe of 125 us, in bytes; above 1024 it is several packets. Setting 0 sends nothing.
static const int SETTING_BYTES[] = {0, 192, 512, 1024, 2048, 3072};
#define SETTINGS (int)(sizeof SETTING_BYTES / sizeof *SETTING_BYTES)
#define MICROFRAMES_PER_S 8000
// uvcvideo asks for at most this many packets in a transfer.
#define PACKETS 32

// struct usbip_iso_packet_descriptor, in the network's byte order.
struct packet {
    uint32_t offset, length, actual_length, status;
};

// The bytes in a microframe of the smallest setting that carries `bytes_per_s` with headers, or else of the largest.
static int reserved_bytes(long bytes_per_s) {
    int setting = 1;
    while (setting < SETTINGS - 1 && SETTING_BYTES[setting] - 12 < bytes_per_s / MICROFRAMES_PER_S) setting++;
    return SETTING_BYTES[setting];
}
// The endpoint's wMaxPacketSize: bytes of a packet, and the additional packets in a microframe from bit 11.
static int max_packet_size(int setting) {
    int packets = (SETTING_BYTES[setting] + 1023) / 1024;
    return SETTING_BYTES[setting] / packets | (packets - 1) << 11;
}

static void start_stream(void);
static void stop_stream(const char *why);

// SET_INTERFACE of the streaming interface: here a stream starts and ends. A host controller that lacks the bandwidth refuses
// the same call with the same error; vhci-hcd counts no bandwidth, but passes the camera's error on.
static int choose_setting(int setting) {
    if (!isochronous || setting >= SETTINGS) return setting ? -EPIPE : 0;
    if (SETTING_BYTES[setting] > bandwidth) return say("no bandwidth for %d bytes", SETTING_BYTES[setting]), -ENOSPC;
    if (setting) start_stream();
    else stop_stream("setting 0");
    return 0;
}
