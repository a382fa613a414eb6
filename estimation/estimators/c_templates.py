"""The C of an exported estimator; `estimation.estimators.c_header` fills in what stands in @."""

HEADER = """\
/* Estimates @TARGET@ from @MEASURED_LIST@. Made by rig export; not to be edited.
 *
 * name_start(&s); then every 1 / @RATE@ s: name_step(&s, measured), measured in SI units in the
 * order above, finite. half_width is that of the interval that covers 95 %, NAN where not known:
 * far from the fitted conditions, opening and at rest. valid is 0 outside the fitted range.
 */
#ifndef NAME_H
#define NAME_H
#include <math.h>
#include <stdint.h>

enum {
    NAME_MEASURED = @MEASURED@, NAME_ROW = @ROW@, NAME_SECTIONS = @SECTION_COUNT@,
    NAME_WINDOWS = @WINDOWS@, NAME_WINDOW = @WINDOW@, NAME_PASTS = @PASTS@
};

typedef struct { float value, half_width; int valid; } name_estimate;

/* the lowest of the last NAME_WINDOW values, as a queue of rising values */
typedef struct {
    double value[NAME_WINDOW];
    uint32_t tick[NAME_WINDOW];
    int first, count;
} name_queue;

/* the last NAME_WINDOW values */
typedef struct { double value[NAME_WINDOW]; } name_past;

typedef struct {
    uint32_t tick;
    double filter[NAME_SECTIONS][NAME_MEASURED][2];
    double angle[NAME_MEASURED], speed[NAME_MEASURED], acceleration[NAME_MEASURED];
    name_queue window[NAME_WINDOWS];
    name_past past[NAME_PASTS];
} name_state;

/* b0 b1 b2 a1 a2 of each section */
static const double name_sections[NAME_SECTIONS][5] = { @SECTIONS@ };

static inline void name_start(name_state *s) { s->tick = 0; }

static inline double name_travel(name_queue *q, uint32_t tick, double value) {
    if (tick == 0) q->first = q->count = 0;
    while (q->count && q->value[(q->first + q->count - 1) % NAME_WINDOW] >= value - @ALIKE@)
        q->count--;
    if (q->count && tick - q->tick[q->first] >= NAME_WINDOW) {
        q->first = (q->first + 1) % NAME_WINDOW;
        q->count--;
    }
    int end = (q->first + q->count) % NAME_WINDOW;
    q->value[end] = value;
    q->tick[end] = tick;
    q->count++;
    return value - q->value[q->first];
}

/* how many ticks ago the lowest value was */
static inline uint32_t name_age(const name_queue *q, uint32_t tick) {
    return tick - q->tick[q->first];
}

static inline void name_keep(name_past *p, uint32_t tick, double value) {
    if (tick == 0) /* as if it had always been at its first value */
        for (int i = 0; i < NAME_WINDOW; i++) p->value[i] = value;
    p->value[tick % NAME_WINDOW] = value;
}

static inline double name_ago(const name_past *p, uint32_t tick, uint32_t ticks) {
    return p->value[(tick + NAME_WINDOW - ticks) % NAME_WINDOW];
}

@MODEL@

static inline name_estimate name_step(name_state *s, const double *measured) {
    double value[NAME_MEASURED], speed[NAME_MEASURED], acceleration[NAME_MEASURED];
    float row[NAME_ROW];
    for (int i = 0; i < NAME_MEASURED; i++) {
        double x = measured[i];
        for (int k = 0; k < NAME_SECTIONS; k++) {
            const double *c = name_sections[k];
            double *z = s->filter[k][i];
            if (s->tick == 0) { /* as if it had always been at its first value */
                double gain = (c[0] + c[1] + c[2]) / (1 + c[3] + c[4]);
                z[1] = (c[2] - c[4] * gain) * x;
                z[0] = (c[1] - c[3] * gain) * x + z[1];
            }
            double y = c[0] * x + z[0];
            z[0] = c[1] * x - c[3] * y + z[1];
            z[1] = c[2] * x - c[4] * y;
            x = y;
        }
        value[i] = x;
@MOTION@
    }
@KEEP@
@FILL@
    (void)value, (void)speed, (void)acceleration;
    if (++s->tick == 0) s->tick = NAME_WINDOW; /* wrapped: never a first sample again */
    return name_model(row);
}
#endif
"""

BANK = """\
enum {
    NAME_PRODUCTS = @PRODUCTS@, NAME_ORDERS = @ORDERS@, NAME_WRIST_ORDERS = @WRIST_ORDERS@,
    NAME_WIDTHS = @WIDTH_COUNT@, NAME_AXES = @AXES@
};

static const uint16_t name_parent[NAME_PRODUCTS] = { @PARENTS@ };
static const uint8_t name_factor[NAME_PRODUCTS] = { @FACTORS@ };
static const float name_weight[@SIZE@] = { @WEIGHTS@ };
static const float name_lowest[@JUDGED@] = { @LOWEST@ };
static const float name_highest[@JUDGED@] = { @HIGHEST@ };
static const uint16_t name_width_column[NAME_WIDTHS] = { @WIDTH_COLUMNS@ };
static const float name_width_weight[NAME_WIDTHS] = { @WIDTH_WEIGHTS@ };

static const float name_lowest_node[NAME_AXES] = { @LOWEST_NODE@ };
static const float name_node_step[NAME_AXES] = { @NODE_STEP@ };
static const int name_nodes[NAME_AXES] = { @NODES@ };
static const float name_beyond[] = { @BEYOND@ };

/* what is added to the squared half width by angle, load, speed in octaves and pose */
static inline float name_added(const float *row) {
    float speed = log2f(fmaxf(row[2] / @GEAR@, @STANDING@)), total = 0.0f;
    const float place[] = { row[0], row[1], speed@POSE_PLACE@ };
    float x[NAME_AXES];
    for (int k = 0; k < NAME_AXES; k++) {
        x[k] = (place[k] - name_lowest_node[k]) / name_node_step[k];
        if (!(x[k] >= 0.0f && x[k] <= (float)(name_nodes[k] - 1))) return NAN;
    }
    for (int corner = 0; corner < 1 << NAME_AXES; corner++) {
        float share = 1.0f;
        int at = 0;
        for (int k = 0; k < NAME_AXES; k++) {
            int low = (int)x[k], up = corner >> k & 1;
            if (low > name_nodes[k] - 2) low = name_nodes[k] - 2;
            share *= up ? x[k] - (float)low : 1.0f - (x[k] - (float)low);
            at = at * name_nodes[k] + low + up;
        }
        total += share * name_beyond[at];
    }
    return total;
}

/* the nearest value fitted: a polynomial carried beyond it grows */
static inline float name_held(const float *row, int k) {
    if (row[k] < name_lowest[k]) return name_lowest[k];
    return row[k] > name_highest[k] ? name_highest[k] : row[k];
}

static inline name_estimate name_model(const float *row) {
    float state[@STATES@], product[NAME_PRODUCTS], angle = name_held(row, 0);
    const float *drive = row + @JUDGED@, *past = drive + 4;
    float speed = row[2] / @GEAR@, load = row[1] / @LOAD@;
    float travel = drive[0] + @SLID@ * fmaxf((drive[1] - @LEAVES@) / @LEAVING@, 0.0f);
    state[0] = (angle - @CENTRE@) / @SCALE@;
    state[1] = load - 1.0f;
    state[2] = speed - 1.0f;
    state[3] = row[3] / @ACCELERATION@;
    state[4] = 1.0f / fmaxf(fabsf(speed), @SLOWEST@);
    state[5] = drive[2] / @LOAD@;
    for (int r = 0; r < 4; r++) state[6 + r] = fminf(travel / (r + 1.0f), 1.0f) - 0.5f;
    for (int r = 0; r < 3; r++)
        state[10 + r] = fminf(travel / ((r + 1.0f) * fmaxf(load, @LIGHTEST@)), 1.0f) - 0.5f;
    state[13] = @POSE@;
    for (int r = 0; r < 2; r++)
        state[14 + r] = drive[3] / @LOAD@ * fmaxf(1.0f - travel / (2.0f * r + 2.0f), 0.0f);
    for (int k = 0; k < @LAGS@; k++) {
        state[16 + k] = past[k] / @LOAD@ - 1.0f;
        state[16 + @LAGS@ + k] = past[@LAGS@ + k] / @ACCELERATION@;
    }
    product[0] = 1.0f;
    float total = name_weight[0];
    for (int k = 1; k < NAME_PRODUCTS; k++) {
        product[k] = product[name_parent[k]] * state[name_factor[k]];
        total += name_weight[k] * product[k];
    }
    float turn = @TURN@ * angle, sine = sinf(turn), cosine = cosf(turn), s = 0.0f, c = 1.0f;
    const float *w = name_weight + NAME_PRODUCTS;
    for (int k = 0; k < NAME_ORDERS; k++, w += 6) {
        float next = s * cosine + c * sine;
        c = c * cosine - s * sine;
        s = next;
        total += s * (w[0] + w[2] * state[1] + w[4] * state[2]);
        total += c * (w[1] + w[3] * state[1] + w[5] * state[2]);
    }
    turn = @WRIST_TURN@ * angle, sine = sinf(turn), cosine = cosf(turn), s = 0.0f, c = 1.0f;
    for (int k = 0; k < NAME_WRIST_ORDERS; k++) {
        float next = s * cosine + c * sine, amplitude = 1.0f;
        c = c * cosine - s * sine;
        s = next;
        for (int power = 0; power < @WRIST_POWERS@; power++, w += 2) {
            total += amplitude * (w[0] * s + w[1] * c);
            amplitude *= state[13];
        }
    }
    float width = 0.0f;
    for (int k = 0; k < NAME_WIDTHS; k++)
        width += name_width_weight[k] * product[name_width_column[k]];
    int valid = 1;
    for (int k = 0; k < @JUDGED@; k++)
        valid &= row[k] >= name_lowest[k] && row[k] <= name_highest[k];
    width = fmaxf(width, @LEAST@);
    name_estimate found = { total, sqrtf(width * width + name_added(row)), valid };
    return found;
}"""

NETWORK = """\
enum { NAME_NODES = @NODES@ };

static const float name_lowest[NAME_ROW] = { @LOWEST@ };
static const float name_highest[NAME_ROW] = { @HIGHEST@ };
static const float name_hidden[NAME_NODES][NAME_ROW + 1] = { @HIDDEN@ };
static const float name_output[NAME_NODES + 1] = { @OUTPUT@ };

static inline name_estimate name_model(const float *row) {
    float unit[NAME_ROW], total = name_output[NAME_NODES];
    int valid = 1;
    for (int i = 0; i < NAME_ROW; i++) {
        unit[i] = 2.0f * (row[i] - name_lowest[i]) / (name_highest[i] - name_lowest[i]) - 1.0f;
        valid &= row[i] >= name_lowest[i] && row[i] <= name_highest[i];
    }
    for (int j = 0; j < NAME_NODES; j++) {
        float sum = name_hidden[j][NAME_ROW];
        for (int i = 0; i < NAME_ROW; i++) sum += name_hidden[j][i] * unit[i];
        total += name_output[j] / (1.0f + expf(-sum));
    }
    float low = @LOW@, high = @HIGH@;
    name_estimate found = { low + (total + 1.0f) * (high - low) / 2.0f, NAN, valid };
    return found;
}"""

DIFFERENCES = """\
        if (s->tick == 0) { s->angle[i] = x; s->speed[i] = 0; }
        speed[i] = (x - s->angle[i]) * @RATE@;
        acceleration[i] = (speed[i] - s->speed[i]) * @RATE@;
        s->angle[i] = x;
        s->speed[i] = speed[i];"""

TRACKER = """\
        /* a Kalman filter in its steady state, on the angle as measured */
        if (s->tick == 0) { s->angle[i] = measured[i]; s->speed[i] = s->acceleration[i] = 0; }
        s->angle[i] += @PERIOD@ * (s->speed[i] + 0.5 * @PERIOD@ * s->acceleration[i]);
        s->speed[i] += @PERIOD@ * s->acceleration[i];
        double innovation = measured[i] - s->angle[i];
        s->angle[i] += @GAIN0@ * innovation;
        speed[i] = s->speed[i] += @GAIN1@ * innovation;
        acceleration[i] = s->acceleration[i] += @GAIN2@ * innovation;"""
