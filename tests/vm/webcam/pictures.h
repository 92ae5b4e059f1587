// Part of webcam.c: pictures from files, and generated ones.

// The size a JPEG file has, and its bytes without Huffman tables if so wished.
static bool scan_jpeg(struct picture *p) {
    uint8_t *b = p->bytes;
    size_t at = 2;
    if (p->length < 4 || b[0] != 0xff || b[1] != 0xd8) return false;
    while (at + 4 <= p->length && b[at] == 0xff) {
        int marker = b[at + 1];
        size_t length = 2 + (b[at + 2] << 8 | b[at + 3]);
        if (at + length > p->length) return false;
        if (marker >= 0xc0 && marker <= 0xc2) p->height = b[at + 5] << 8 | b[at + 6], p->width = b[at + 7] << 8 | b[at + 8];
        if (marker == 0xda) return p->width > 0;
        if (marker == 0xc4 && no_dht) {
            memmove(b + at, b + at + length, p->length - at - length);
            p->length -= length;
        } else {
            at += length;
        }
    }
    return false;
}
static void add_file(const char *path) {
    FILE *f = fopen(path, "rb");
    if (!f) die(path);
    struct picture p = {0};
    size_t room = 0, got;
    do {
        p.bytes = realloc(p.bytes, room += 1 << 18);
        got = fread(p.bytes + p.length, 1, room - p.length, f);
        p.length += got;
    } while (got > 0);
    fclose(f);
    if (!scan_jpeg(&p)) {
        say("%s: not a JPEG picture", path);
        exit(2);
    }
    pictures = realloc(pictures, (picture_count + 1) * sizeof *pictures);
    pictures[picture_count++] = p;
}
static int is_jpeg(const struct dirent *e) {
    const char *dot = strrchr(e->d_name, '.');
    return dot && (!strcasecmp(dot, ".jpg") || !strcasecmp(dot, ".jpeg"));
}
static void add(const char *path) {
    struct dirent **list;
    int count = scandir(path, &list, is_jpeg, alphasort);
    if (count < 0) return add_file(path);
    for (int i = 0; i < count; i++) {
        char file[4096];
        snprintf(file, sizeof file, "%s/%s", path, list[i]->d_name);
        add_file(file);
    }
}

static long brightness_now(void);

// The generated scene, in blocks of 8x8: a slope of grey, and a bright square that moves by 8 pixels a picture.
static void scene(int bx, int by, int blocks_x, long number, int *y, int *u, int *v) {
    int square = (int)(number % (blocks_x - 8));
    bool inside = bx >= square && bx < square + 8 && by >= 8 && by < 16;
    long luma = (inside ? 200 : 40 + bx * 120 / blocks_x) + brightness_now();
    *y = luma < 16 ? 16 : luma > 235 ? 235 : (int)luma;
    *u = inside ? 90 : 128;
    *v = inside ? 200 : 128;
}

// A JPEG writer that only knows even blocks: 4:2:2, the standard tables, no AC coefficients.
static const uint8_t DC_BITS[2][16] = {{0, 1, 5, 1, 1, 1, 1, 1, 1}, {0, 3, 1, 1, 1, 1, 1, 1, 1, 1, 1}};
// The standard Huffman tables of ITU-T T.81, annex K.3, for AC coefficients.
static const uint8_t AC_BITS[2][16] = {{0,2,1,3,3,2,4,3,5,5,4,4,0,0,1,125}, {0,2,1,2,4,4,3,4,7,5,4,4,0,1,2,119}};
static const uint8_t AC_VALUES[2][162] = {{1,2,3,0,4,17,5,18,33,49,65,6,19,81,97,7,34,113,20,50,129,145,161,8,35,66,177,193,21,82,209,240,36,51,98,114,130,9,10,22,23,24,25,26,37,38,39,40,41,42,52,53,54,55,56,57,58,67,68,69,70,71,72,73,74,83,84,85,86,87,88,89,90,99,100,101,102,103,104,105,106,115,116,117,118,119,120,121,122,131,132,133,134,135,136,137,138,146,147,148,149,150,151,152,153,154,162,163,164,165,166,167,168,169,170,178,179,180,181,182,183,184,185,186,194,195,196,197,198,199,200,201,202,210,211,212,213,214,215,216,217,218,225,226,227,228,229,230,231,232,233,234,241,242,243,244,245,246,247,248,249,250},
 {0,1,2,3,17,4,5,33,49,6,18,65,81,7,97,113,19,34,50,129,8,20,66,145,161,177,193,9,35,51,82,240,21,98,114,209,10,22,36,52,225,37,241,23,24,25,26,38,39,40,41,42,53,54,55,56,57,58,67,68,69,70,71,72,73,74,83,84,85,86,87,88,89,90,99,100,101,102,103,104,105,106,115,116,117,118,119,120,121,122,130,131,132,133,134,135,136,137,138,146,147,148,149,150,151,152,153,154,162,163,164,165,166,167,168,169,170,178,179,180,181,182,183,184,185,186,194,195,196,197,198,199,200,201,202,210,211,212,213,214,215,216,217,218,226,227,228,229,230,231,232,233,234,242,243,244,245,246,247,248,249,250}};
static uint64_t bit_store;
static int bit_count;
static void put_bits(struct picture *p, uint32_t value, int count) {
    bit_store = bit_store << count | value;
    bit_count += count;
    while (bit_count >= 8) {
        uint8_t byte = bit_store >> (bit_count -= 8);
        p->bytes[p->length++] = byte;
        if (byte == 0xff) p->bytes[p->length++] = 0;
    }
}
static void put_block(struct picture *p, int table, int difference) {
    int size = 0;
    while (abs(difference) >> size) size++;
    uint32_t code = 0, index = 0;
    for (int length = 1; length <= 16; length++, code <<= 1)
        for (int i = 0; i < DC_BITS[table][length - 1]; i++, code++)
            if ((int)index++ == size) {
                put_bits(p, code, length);
                if (size) put_bits(p, difference < 0 ? difference + (1 << size) - 1 : difference, size);
                // End of block.
                put_bits(p, table ? 0 : 10, table ? 2 : 4);
                return;
            }
}
static void put(struct picture *p, const void *bytes, size_t count) {
    memcpy(p->bytes + p->length, bytes, count);
    p->length += count;
}
static void generate_jpeg(struct picture *p, int width, int height, long number) {
    p->bytes = realloc(p->bytes, (size_t)width * height + 4096);
    p->length = 0;
    put(p, "\xff\xd8", 2);
    for (int table = 0; table < 2; table++) {
        uint8_t quantization[69] = {0xff, 0xdb, 0, 67, table};
        memset(quantization + 5, 8, 64);
        put(p, quantization, sizeof quantization);
    }
    uint8_t frame[] = {0xff, 0xc0, 0, 17, 8, height >> 8, height, width >> 8, width, 3, 1, 0x21, 0, 2, 0x11, 1, 3, 0x11, 1};
    put(p, frame, sizeof frame);
    for (int table = 0; table < 2 && !no_dht; table++) {
        uint8_t dc[5 + 16] = {0xff, 0xc4, 0, 19 + 12, table}, ac[5] = {0xff, 0xc4, 0, 19 + 162, 0x10 | table};
        memcpy(dc + 5, DC_BITS[table], 16);
        put(p, dc, sizeof dc);
        put(p, "\0\1\2\3\4\5\6\7\10\11\12\13", 12);
        put(p, ac, sizeof ac);
        put(p, AC_BITS[table], 16);
        put(p, AC_VALUES[table], 162);
    }
    put(p, "\xff\xda\0\14\3\1\0\2\21\3\21\0\77\0", 14);
    int last[3] = {0, 0, 0};
    bit_store = bit_count = 0;
    for (int by = 0; by < height / 8; by++)
        for (int bx = 0; bx < width / 8; bx += 2) {
            int c[2][3];
            for (int i = 0; i < 2; i++) scene(bx + i, by, width / 8, number, &c[i][0], &c[i][1], &c[i][2]);
            // With quantization by 8 the DC coefficient is the mean itself, less 128.
            for (int i = 0; i < 2; i++) {
                put_block(p, 0, c[i][0] - 128 - last[0]);
                last[0] = c[i][0] - 128;
            }
            for (int k = 1; k < 3; k++) {
                put_block(p, 1, c[0][k] - 128 - last[k]);
                last[k] = c[0][k] - 128;
            }
        }
    put_bits(p, 0x7f, 7);
    put(p, "\xff\xd9", 2);
}
static void generate_yuyv(struct picture *p, int width, int height, long number) {
    p->length = (size_t)width * height * 2;
    p->bytes = realloc(p->bytes, p->length);
    for (int by = 0; by < height / 8; by++) {
        uint8_t *row = p->bytes + (size_t)by * 8 * width * 2;
        for (int bx = 0; bx < width / 8; bx++) {
            int y, u, v;
            scene(bx, by, width / 8, number, &y, &u, &v);
            for (int i = 0; i < 4; i++) memcpy(row + bx * 16 + i * 4, (uint8_t[]){y, u, y, v}, 4);
        }
        for (int i = 1; i < 8; i++) memcpy(row + (size_t)i * width * 2, row, width * 2);
    }
}
static void generate_nv12(struct picture *p, int width, int height, long number) {
    size_t luma = (size_t)width * height;
    p->length = luma * 3 / 2;
    p->bytes = realloc(p->bytes, p->length);
    for (int by = 0; by < height / 8; by++)
        for (int bx = 0; bx < width / 8; bx++) {
            int y, u, v;
            scene(bx, by, width / 8, number, &y, &u, &v);
            for (int row = by * 8; row < by * 8 + 8; row++) memset(p->bytes + (size_t)row * width + bx * 8, y, 8);
            for (int row = by * 4; row < by * 4 + 4; row++)
                for (int i = 0; i < 4; i++) memcpy(p->bytes + luma + (size_t)row * width + bx * 8 + i * 2, (uint8_t[]){u, v}, 2);
        }
}
// An access unit that holds its delimiter and filler data, and no picture.
static void generate_h264(struct picture *p, int width, int height, long number) {
    static const uint8_t head[] = {0, 0, 0, 1, 0x09, 0x10, 0, 0, 0, 1, 0x0c};
    (void)width, (void)height, (void)number;
    p->length = 2000;
    p->bytes = realloc(p->bytes, p->length);
    memset(p->bytes, 0xff, p->length);
    memcpy(p->bytes, head, sizeof head);
    p->bytes[p->length - 1] = 0x80;
}
