// Part of webcam.c: descriptors, and the requests of the USB Video Class.

static uint8_t config[2048];
static size_t config_length;
static void d(const uint8_t *bytes, size_t count) {
    memcpy(config + config_length, bytes, count);
    config_length += count;
}
#define D(...) d((uint8_t[]){__VA_ARGS__}, sizeof(uint8_t[]){__VA_ARGS__})
#define W(x) (uint8_t)(x), (uint8_t)((x) >> 8)
#define L(x) W(x), W((uint32_t)(x) >> 16)

// Bytes of a picture at most: the length of a raw one, a generous one for the others.
static uint32_t largest(int kind, struct size s) { return s.width * s.height * (kind == NV12 ? 3 : 4) / 2; }
static void choose_formats(const char *text) {
    format_count = 0;
    char copy[256], *rest, *inner;
    snprintf(copy, sizeof copy, "%s", text);
    for (char *word = strtok_r(copy, ",", &rest); word && format_count < KINDS; word = strtok_r(NULL, ",", &rest)) {
        struct format *f = &formats[format_count++];
        char *part = strtok_r(word, ":", &inner);
        *f = (struct format){0};
        while (f->kind < KINDS && strcasecmp(part, KIND_NAMES[f->kind])) f->kind++;
        if (f->kind == KINDS) errno = EINVAL, die("--formats");
        while ((part = strtok_r(NULL, ":", &inner)) && f->count < 4) {
            struct size *one = &f->sizes[f->count++];
            if (sscanf(part, "%dx%d", &one->width, &one->height) != 2 || one->width % 16 || one->height % 8 || one->width < 144)
                errno = EINVAL, die("--formats");
        }
        if (!f->count) f->sizes[f->count++] = (struct size){640, 480};
    }
    config_length = 0;
    D(9, 2, 0, 0, 2, 1, 0, 0x80, 250);
    D(8, 0x0b, 0, 2, 0x0e, 3, 0, 2);
    // Video control: camera terminal 1, processing unit 2, output terminal 3.
    D(9, 4, 0, 0, 0, 0x0e, 1, 0, 2);
    D(13, 0x24, 1, W(0x0110), W(13 + 18 + 12 + 9), L(CLOCK_HZ), 1, 1);
    D(18, 0x24, 2, 1, W(0x0201), 0, 0, 0, 0, 0, 0, 0, 0, 3, 0x0e, 0, 0);
    D(12, 0x24, 5, 2, 1, W(0), 2, W(0x164b), 0, 0);
    D(9, 0x24, 3, 3, W(0x0101), 0, 2, 0);
    // Video streaming: the only setting of a bulk camera, the silent one of an isochronous camera.
    D(9, 4, 1, 0, !isochronous, 0x0e, 2, 0, 0);
    size_t header = config_length;
    D(13, 0x24, 1, format_count, W(0), 0x80 | STREAM_EP, 0, 3, 0, 0, 0, 1);
    for (int i = 0; i < format_count; i++) D(0);
    config[header] += format_count;
    for (int i = 0; i < format_count; i++) {
        struct format *f = &formats[i];
        if (f->kind == MJPEG) D(11, 0x24, 6, i + 1, f->count, 1, 1, 0, 0, 0, 0);
        else {
            D(f->kind == H264 ? 28 : 27, 0x24, f->kind == H264 ? 0x10 : 4, i + 1, f->count);
            d((const uint8_t *)GUIDS[f->kind], 4);
            D(0, 0, 0x10, 0, 0x80, 0, 0, 0xaa, 0, 0x38, 0x9b, 0x71, f->kind == NV12 ? 12 : 16, 1, 0, 0, 0, 0);
            // The pictures differ in length.
            if (f->kind == H264) D(1);
        }
        for (int k = 0; k < f->count; k++) {
            struct size s = f->sizes[k];
            uint32_t bits = largest(f->kind, s) * 8;
            D(26 + 4 * rate_count, 0x24, f->kind == MJPEG ? 7 : f->kind == H264 ? 0x11 : 5, k + 1, 0, W(s.width), W(s.height),
              L(bits * 5), L(bits * 30));
            if (f->kind != H264) D(L(largest(f->kind, s)));
            D(L(10000000 / rates[0]), rate_count);
            // Bytes in a row, which compressed pictures do not have.
            if (f->kind == H264) D(L(0));
            for (int r = 0; r < rate_count; r++) D(L(10000000 / rates[r]));
        }
        D(6, 0x24, 0x0d, 1, 1, 4);
    }
    memcpy(config + header + 4, (uint8_t[]){W(config_length - header)}, 2);
    if (!isochronous) D(7, 5, 0x80 | STREAM_EP, 2, W(512), 0);
    for (int setting = 1; isochronous && setting < SETTINGS; setting++) {
        D(9, 4, 1, setting, 1, 0x0e, 2, 0, 0);
        D(7, 5, 0x80 | STREAM_EP, 5, W(max_packet_size(setting)), 1);
    }
    memcpy(config + 2, (uint8_t[]){W(config_length)}, 2);
}

static size_t descriptor(int type, int index, uint8_t *to) {
    static const uint8_t device[] = {18, 1, W(0x0200), 0xef, 2, 1, 64, W(0x1209), W(0x0001), W(0x0100), 1, 2, 3, 1};
    static const uint8_t qualifier[] = {10, 6, W(0x0200), 0xef, 2, 1, 64, 1, 0};
    const char *strings[] = {NULL, "bokehcam tests", name, serial};
    switch (type) {
        case 1: return memcpy(to, device, 18), 18;
        case 2:
        case 7:
            memcpy(to, config, config_length);
            to[1] = type;
            return config_length;
        case 6: return memcpy(to, qualifier, 10), 10;
        case 3:
            if (index == 0) return memcpy(to, "\4\3\11\4", 4), 4;
            if (index > 3) return 0;
            to[0] = 2 + 2 * strlen(strings[index]), to[1] = 3;
            for (int i = 0; strings[index][i]; i++) to[2 + 2 * i] = strings[index][i], to[3 + 2 * i] = 0;
            return to[0];
    }
    return 0;
}

// ---------------------------------------------------------------------------------------------------- class requests

static struct control {
    int unit, selector, length;
    int32_t min, max, step, preset, now;
    const char *name;
} controls[] = {
    // For modes the step is the set of those there are.
    {1, 0x02, 1, 0, 0, 0x09, 0x08, 0x08, "exposure mode"},
    {1, 0x03, 1, 0, 1, 1, 0, 0, "exposure priority"},
    {1, 0x04, 4, 3, 2047, 1, 250, 250, "exposure time"},
    {2, 0x02, 2, -64, 64, 1, 0, 0, "brightness"},
    {2, 0x03, 2, 0, 64, 1, 32, 32, "contrast"},
    {2, 0x07, 2, 0, 128, 1, 64, 64, "saturation"},
    {2, 0x04, 2, 0, 100, 1, 0, 0, "gain"},
    {2, 0x05, 1, 0, 2, 1, 1, 1, "power line"},
    {2, 0x0a, 2, 2800, 6500, 1, 4600, 4600, "white balance"},
    {2, 0x0b, 1, 0, 1, 1, 1, 1, "white balance auto"},
};
#define CONTROLS (sizeof controls / sizeof *controls)
static long brightness_now(void) { return controls[3].now; }

static uint8_t last_error;
static struct probe {
    uint8_t format, frame;
    uint32_t interval;
} probed, committed;

// The nearest that the camera can do.
static struct probe settle(struct probe p) {
    if (p.format < 1 || p.format > format_count) p.format = 1;
    if (p.frame < 1 || p.frame > formats[p.format - 1].count) p.frame = 1;
    uint32_t best = 10000000 / rates[0];
    for (int r = 0; r < rate_count; r++) {
        uint32_t one = 10000000 / rates[r];
        if (p.interval && labs((long)one - (long)p.interval) < labs((long)best - (long)p.interval)) best = one;
    }
    p.interval = best;
    return p;
}
// As after plugging in and after a reset, when the kernel looks for a driver.
static bool node_known;
static void forget(void) {
    node_known = false;
    probed = committed = settle((struct probe){1, 1, 0});
    for (size_t i = 0; i < CONTROLS; i++) controls[i].now = controls[i].preset;
}
static long payload_bytes(void) { return payload_max ? payload_max : 16384; }
static size_t write_probe(struct probe p, uint8_t *to) {
    struct format *f = &formats[p.format - 1];
    uint32_t picture_max = largest(f->kind, f->sizes[p.frame - 1]);
    // Compressed pictures have a fourth of that; a rate is 100 ns over an interval.
    long sent = picture_max / (f->kind == MJPEG || f->kind == H264 ? 4 : 1);
    uint32_t payload = isochronous && !payload_max ? reserved_bytes(sent * (10000000 / p.interval)) : payload_bytes();
    uint8_t bytes[34] = {W(1), p.format, p.frame, L(p.interval), W(0), W(0), W(0), W(0), W(50),
                         L(picture_max), L(payload), L(CLOCK_HZ), 3, 1, 1, 1};
    memcpy(to, bytes, sizeof bytes);
    return sizeof bytes;
}

static int fail(int code) {
    last_error = code;
    return -EPIPE;
}

// Answers a request to an interface: the count of bytes in `data`, or an error.
static int class_request(const uint8_t *setup, uint8_t *data, int length) {
    int request = setup[1], selector = setup[3], interface = setup[4], unit = setup[5];
    if (interface == 1) {
        if (selector != 1 && selector != 2) return fail(6);
        struct probe *target = selector == 1 ? &probed : &committed;
        switch (request) {
            case SET_CUR:
                if (length < 26) return fail(8);
                if (selector == 2 && busy) return fail(1);
                *target = settle((struct probe){data[2], data[3], data[4] | data[5] << 8 | data[6] << 16 | data[7] << 24});
                if (selector == 2 && !isochronous) start_stream();
                return length;
            case GET_CUR: return write_probe(settle(*target), data);
            case GET_MIN:
            case GET_DEF: return write_probe(settle((struct probe){1, 1, 0}), data);
            case GET_MAX: return write_probe(settle((struct probe){target->format, target->frame, 0}), data);
            case GET_LEN: return data[0] = 34, data[1] = 0, 2;
            case GET_INFO: return data[0] = 3, 1;
        }
        return fail(7);
    }
    if (unit == 0) {
        if (selector == 2 && request == GET_CUR) return data[0] = last_error, 1;
        if (selector == 2 && request == GET_INFO) return data[0] = 1, 1;
        return fail(6);
    }
    for (size_t i = 0; i < CONTROLS; i++) {
        struct control *c = &controls[i];
        if (c->unit != unit || c->selector != selector) continue;
        // What is set automatically cannot be set by hand.
        bool automatic = (i == 2 && controls[0].now == 8) || (i == 8 && controls[9].now == 1);
        int32_t value;
        switch (request) {
            case SET_CUR:
                if (automatic) return fail(2);
                value = c->length == 1 ? data[0]
                        : c->length == 2 ? (int16_t)(data[0] | data[1] << 8)
                                         : (int32_t)(data[0] | data[1] << 8 | data[2] << 16 | (uint32_t)data[3] << 24);
                if (i ? value < c->min || value > c->max : value != 1 && value != 8) return fail(4);
                c->now = value;
                say("set %s %d", c->name, value);
                return length;
            case GET_CUR: value = c->now; break;
            case GET_MIN: value = c->min; break;
            case GET_MAX: value = c->max; break;
            case GET_RES: value = c->step; break;
            case GET_DEF: value = c->preset; break;
            case GET_LEN: return data[0] = c->length, data[1] = 0, 2;
            case GET_INFO: return data[0] = 3 | (automatic ? 4 : 0), 1;
            default: return fail(7);
        }
        memcpy(data, (uint8_t[]){L(value)}, 4);
        return c->length;
    }
    return fail(6);
}

static int control_request(const uint8_t *setup, uint8_t *data, int length) {
    int type = setup[0], request = setup[1], value = setup[2] | setup[3] << 8, index = setup[4] | setup[5] << 8;
    if ((type & 0x60) == 0x20) return class_request(setup, data, length);
    switch (type << 8 | request) {
        case 0x8006: {
            size_t count = descriptor(value >> 8, value & 0xff, data);
            return count ? (int)count : -EPIPE;
        }
        case 0x8000:
        case 0x8100:
        case 0x8200: return data[0] = data[1] = 0, 2;
        case 0x8008: return data[0] = 1, 1;
        case 0x810a: return data[0] = 0, 1;
        case 0x0009:
            stop_stream("configured");
            forget();
            return 0;
        case 0x010b: return index == 1 ? choose_setting(value) : value ? -EPIPE : 0;
        case 0x0001:
        case 0x0003: return 0;
        case 0x0201:
            // So a bulk camera is told that the stream is over.
            if (index == (0x80 | STREAM_EP)) stop_stream("endpoint cleared");
            return 0;
    }
    return -EPIPE;
}
