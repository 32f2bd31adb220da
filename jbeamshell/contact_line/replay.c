/* Derivatives of the vertices of a branch, from the record of its events.

   The same as replay.py, which explains it: at an event the contact solves linear equations, so that
   its derivative is that of their solution.  ``forward`` pushes tangents of the branch to its
   vertices, ``backward`` pulls cotangents of the vertices back; one is the transpose of the other.
   The tableau is kept here, because each derivative multiplies it by a vector at each event. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "xla.h"

#define R restrict /* vectors that do not overlap */

enum { ALONG, AGAINST, STICK, OPEN, CLOSE, KINDS };
enum { BY_ROW, AT_ONCE, AT_RETURN, FIXED };
enum { SNAPSHOT = 8 }; /* events from one tableau that is kept to the next */

/* Equations of a branch, or tangents or cotangents of them: see tableau.py and events.Search. */
typedef struct { double *K, *pull, *mu, *r_0, *lift, *extra, *back; } Equations;

/* Event as it was found, with what its derivative needs. */
typedef struct {
    double *found, *velocity, *sigma, *reaction; /* (m,), (m,), (k,), (n,) */
    double side, slope, tau, rate_t, rate_n;
    unsigned char *moves;                        /* (m,) */
    int kind, node, cause, vertex, keep, extra;  /* extra: place in (2, k), or -1 */
} Step;

typedef struct {
    int k, n, m, count;
    Equations at;
    const unsigned char *opened;
    const int32_t *events; /* (count, 5) */
    const double *tau;
    double *T, *answer, *rate, *held, *sigma, *row, *share, now; /* tableau, where it is */
    unsigned char *open;
    Step *steps;
    double *kept; /* tableaux before every eighth event, and the eight of one stretch */
    double *spare; /* (4, m) */
} Replay;

/* --- tableau ----------------------------------------------------------------------------------- */

typedef struct { int i, q; double add, rest; } Exchange;

static Exchange exchange_of(const Replay *p, int kind, int node) {
    int slips = kind < STICK, q = p->k + node;
    double add = slips ? (kind == ALONG ? 1.0 : -1.0) * *p->at.mu : 0.0;
    return (Exchange){kind < OPEN ? node : q, q, add, kind == STICK ? -p->sigma[node] * *p->at.mu : 0.0};
}

/* Tableau T with row and column i exchanged; fills row and share. */
static void exchange(double *T, int m, Exchange e, double *R row, double *R share) {
    double *R line = T + (size_t)e.i * m;
    const double *R beside = T + (size_t)e.q * m;
    for (int j = 0; j < m; ++j) row[j] = line[j] + e.add * beside[j];
    double pivot = row[e.i];
    for (int j = 0; j < m; ++j) share[j] = T[(size_t)j * m + e.i] / pivot;
    for (int j = 0; j < m; ++j) {
        if (j == e.i || share[j] == 0.0) continue;
        double *R other = T + (size_t)j * m, part = share[j];
        for (int l = 0; l < m; ++l) other[l] -= part * row[l];
        other[e.i] = part;
    }
    for (int j = 0; j < m; ++j) line[j] = -row[j] / pivot;
    line[e.i] = 1.0 / pivot;
    if (e.rest != 0.0)
        for (int j = 0; j < m; ++j) line[j] += e.rest * beside[j];
}

static void happen(Replay *p, int kind, int node, int keep) {
    Exchange e = exchange_of(p, kind, node);
    double *rate = p->rate, pivot;
    exchange(p->T, p->m, e, p->row, p->share);
    pivot = p->row[e.i];
    double entry = rate[e.i] + e.add * rate[e.q];
    for (int r = 0; r < p->m; ++r) rate[r] -= p->share[r] * entry;
    rate[e.i] = (e.rest != 0.0 ? e.rest * rate[e.q] : 0.0) - entry / pivot;
    double answer = p->answer[e.i] + e.add * p->answer[e.q];
    p->answer[e.i] = p->held[e.i] + (e.rest != 0.0 ? e.rest * p->answer[e.q] : 0.0);
    p->held[e.i] = kind <= STICK || keep ? answer : kind == CLOSE ? -p->at.lift[node] : 0.0;
    if (kind < OPEN) p->sigma[node] = kind == ALONG ? 1.0 : kind == AGAINST ? -1.0 : 0.0;
    else p->open[node] = kind == OPEN;
}

static void begin(Replay *p) {
    int m = p->m;
    memcpy(p->T, p->at.K, (size_t)m * m * sizeof(double));
    memcpy(p->answer, p->at.r_0, m * sizeof(double));
    for (int r = 0; r < m; ++r) p->rate[r] = -p->at.pull[r], p->held[r] = 0.0;
    for (int i = 0; i < p->n; ++i) p->sigma[i] = 0.0, p->open[i] = 0;
    p->now = 0.0;
    for (int i = 0; i < p->n; ++i)
        if (p->opened[i]) {
            if (i < p->k) happen(p, p->answer[i] > 0.0 ? AGAINST : ALONG, i, 1);
            happen(p, OPEN, i, 1);
        }
}

static double dot(const double *R a, const double *R b, int m) {
    double sum = 0.0;
    for (int r = 0; r < m; ++r) sum += a[r] * b[r];
    return sum;
}

/* Walks the events again, and fills the steps. */
static void walk_again(Replay *p) {
    int k = p->k, n = p->n, m = p->m;
    begin(p);
    for (int e = 0; e < p->count; ++e) {
        const int32_t *event = p->events + 5 * (size_t)e;
        Step *s = &p->steps[e];
        s->kind = event[0], s->node = event[1], s->cause = event[2], s->vertex = event[3], s->keep = event[4];
        s->tau = p->tau[e];
        double step = s->tau - p->now;
        for (int r = 0; r < m; ++r) p->answer[r] += p->rate[r] * step;
        p->now = s->tau;
        for (int r = 0; r < m; ++r) {
            s->moves[r] = r < k ? p->sigma[r] != 0.0 : p->open[r - k];
            s->found[r] = s->moves[r] ? p->answer[r] : p->held[r];
            s->velocity[r] = s->moves[r] ? p->rate[r] : 0.0;
        }
        memcpy(s->sigma, p->sigma, k * sizeof(double));
        for (int i = 0; i < n; ++i) s->reaction[i] = p->open[i] ? p->held[k + i] : p->answer[k + i];
        if (e % SNAPSHOT == 0)
            memcpy(p->kept + (size_t)(e / SNAPSHOT) * m * m, p->T, (size_t)m * m * sizeof(double));
        if (s->kind >= KINDS) continue; /* the end */
        int t = s->node < k ? s->node : k - 1, q = k + s->node;
        s->side = s->kind == ALONG ? 1.0 : s->kind == AGAINST ? -1.0 : 0.0;
        s->slope = s->kind < STICK ? *p->at.mu * p->rate[q] + s->side * p->rate[t] : p->rate[q];
        s->rate_t = dot(p->at.K + (size_t)t * m, s->velocity, m) - p->at.pull[t];
        s->rate_n = dot(p->at.K + (size_t)q * m, s->velocity, m) - p->at.pull[q];
        s->extra = s->kind < STICK && s->tau < *p->at.back ? (s->kind == ALONG ? 0 : k) + t : -1;
        happen(p, s->kind, s->node, s->keep);
    }
}

/* --- tangents ---------------------------------------------------------------------------------- */

/* Tangents of the vertices, (vertices,) and (vertices, m), from those of the branch. */
static void forward(Replay *p, const Equations *d, double *tau_out, double *change_out, double *R held, double *R f, double *R x, double *R c) {
    int k = p->k, m = p->m;
    double mu = *p->at.mu, tau = 0.0;
    begin(p);
    for (int i = 0; i < m; ++i) held[i] = 0.0;
    for (int i = 0; i < p->n; ++i) {
        if (i < k && p->sigma[i] != 0.0)
            held[i] = d->r_0[i] + p->sigma[i] * (*d->mu * p->at.r_0[k + i] + mu * d->r_0[k + i]);
        if (p->open[i]) held[k + i] = d->r_0[k + i];
    }
    for (int e = 0; e < p->count; ++e) {
        const Step *s = &p->steps[e];
        for (int r = 0; r < m; ++r)
            f[r] = d->r_0[r] + dot(d->K + (size_t)r * m, s->found, m) - d->pull[r] * s->tau;
        for (int r = 0; r < m; ++r) {
            x[r] = held[r];
            if (!s->moves[r]) continue;
            x[r] -= f[r];
            if (r < k) x[r] -= s->sigma[r] * (*d->mu * s->reaction[r] + mu * f[k + r]);
        }
        for (int r = 0; r < m; ++r) c[r] = s->moves[r] ? dot(p->T + (size_t)r * m, x, m) : held[r];
        int ends = s->kind >= KINDS, t = s->node < k ? s->node : k - 1, q = k + s->node;
        double g_t = 0.0, g_n = 0.0, room = 0.0;
        if (!ends) {
            g_t = f[t] + dot(p->at.K + (size_t)t * m, c, m);
            g_n = f[q] + dot(p->at.K + (size_t)q * m, c, m);
            room = s->kind == CLOSE ? d->lift[s->node] + c[q] : g_n;
            if (s->kind < STICK) room = *d->mu * s->reaction[s->node] + mu * g_n + s->side * g_t;
            if (s->extra >= 0) room += d->extra[s->extra];
        }
        tau = s->cause == BY_ROW ? -room / s->slope : s->cause == AT_ONCE ? tau : s->cause == AT_RETURN ? *d->back : 0.0;
        for (int r = 0; r < m; ++r) c[r] += s->velocity[r] * tau;
        if (!ends) {
            int row = s->kind < OPEN ? t : q;
            g_t += s->rate_t * tau, g_n += s->rate_n * tau;
            if (s->kind < STICK) held[row] = g_t + s->side * (*d->mu * s->reaction[s->node] + mu * g_n);
            else if (s->kind == STICK) held[row] = c[t];
            else if (s->kind == OPEN) held[row] = 0.0;
            else held[row] = s->keep ? c[q] : -d->lift[s->node];
            happen(p, s->kind, s->node, s->keep);
        }
        if (s->vertex > 0) {
            tau_out[s->vertex] = tau;
            memcpy(change_out + (size_t)s->vertex * m, c, m * sizeof(double));
        }
    }
}

/* Cotangents of the branch, added, from those of the vertices. */
static void backward(Replay *p, Equations *d, const double *tau_in, const double *change_in, double *R held, double *R f, double *R x, double *R c, unsigned char *taken) {
    int k = p->k, m = p->m, first = p->count;
    size_t size = (size_t)m * m;
    double mu = *p->at.mu, tau = 0.0, *window = p->kept + (size_t)((p->count + SNAPSHOT - 1) / SNAPSHOT) * size;
    for (int r = 0; r < m; ++r) held[r] = 0.0;
    for (int e = p->count - 1; e >= 0; --e) {
        const Step *s = &p->steps[e];
        if (e < first) { /* tableaux of the stretch that this event is in */
            first = e / SNAPSHOT * SNAPSHOT;
            memcpy(window, p->kept + (size_t)(e / SNAPSHOT) * size, size * sizeof(double));
            for (int j = first; j < e; ++j) {
                double *T = window + (size_t)(j - first + 1) * size;
                memcpy(T, T - size, size * sizeof(double));
                memcpy(p->sigma, p->steps[j].sigma, k * sizeof(double));
                exchange(T, m, exchange_of(p, p->steps[j].kind, p->steps[j].node), p->row, p->share);
            }
        }
        const double *T = window + (size_t)(e - first) * size;
        int ends = s->kind >= KINDS, t = s->node < k ? s->node : k - 1, q = k + s->node;
        double g_t = 0.0, g_n = 0.0, reaction = ends ? 0.0 : s->reaction[s->node];
        for (int r = 0; r < m; ++r) c[r] = f[r] = 0.0;
        if (s->vertex > 0 && !taken[s->vertex]) { /* the last event at a vertex made it */
            taken[s->vertex] = 1, tau += tau_in[s->vertex];
            memcpy(c, change_in + (size_t)s->vertex * m, m * sizeof(double));
        }
        if (!ends) {
            int row = s->kind < OPEN ? t : q;
            double h = held[row];
            held[row] = 0.0;
            if (s->kind < STICK) g_t += h, g_n += s->side * mu * h, *d->mu += s->side * reaction * h;
            else if (s->kind == STICK) c[t] += h;
            else if (s->kind == CLOSE && s->keep) c[q] += h;
            else if (s->kind == CLOSE) d->lift[s->node] -= h;
            tau += s->rate_t * g_t + s->rate_n * g_n;
        }
        tau += dot(s->velocity, c, m);
        if (s->cause == BY_ROW && !ends) {
            double room = -tau / s->slope;
            if (s->kind < STICK) g_t += s->side * room, g_n += mu * room, *d->mu += reaction * room;
            else if (s->kind == CLOSE) d->lift[s->node] += room, c[q] += room;
            else g_n += room;
            if (s->extra >= 0) d->extra[s->extra] += room;
        }
        if (s->cause == AT_RETURN) *d->back += tau;
        if (s->cause != AT_ONCE) tau = 0.0;
        if (!ends) {
            f[t] += g_t, f[q] += g_n;
            for (int r = 0; r < m; ++r)
                c[r] += p->at.K[(size_t)t * m + r] * g_t + p->at.K[(size_t)q * m + r] * g_n;
        }
        for (int r = 0; r < m; ++r) x[r] = 0.0;
        for (int r = 0; r < m; ++r) {
            if (!s->moves[r]) held[r] += c[r];
            else if (c[r] != 0.0)
                for (int j = 0; j < m; ++j) x[j] += T[(size_t)r * m + j] * c[r];
        }
        for (int r = 0; r < m; ++r) {
            held[r] += x[r];
            if (!s->moves[r]) continue;
            f[r] -= x[r];
            if (r < k) *d->mu -= s->sigma[r] * s->reaction[r] * x[r], f[k + r] -= s->sigma[r] * mu * x[r];
        }
        for (int r = 0; r < m; ++r) {
            if (f[r] == 0.0) continue;
            d->r_0[r] += f[r], d->pull[r] -= s->tau * f[r];
            double *R line = d->K + (size_t)r * m;
            for (int j = 0; j < m; ++j) line[j] += f[r] * s->found[j];
        }
    }
    begin(p);
    for (int i = 0; i < p->n; ++i) {
        if (i < k && p->sigma[i] != 0.0) {
            d->r_0[i] += held[i], d->r_0[k + i] += p->sigma[i] * mu * held[i];
            *d->mu += p->sigma[i] * p->at.r_0[k + i] * held[i];
        }
        if (p->open[i]) d->r_0[k + i] += held[k + i];
    }
}

/* --- handlers for XLA --------------------------------------------------------------------------- */

enum { BRANCH = 7, GIVEN = 11 };
/* matrix, pull, friction, r_0, lift, extra, back; open nodes, events, their loads, their number */
static const int RANKS[GIVEN] = {2, 1, 0, 1, 1, 2, 0, 1, 2, 1, 0};
static const int BYTES[GIVEN] = {8, 8, 8, 8, 8, 8, 8, 1, 4, 8, 4};

static char *array_in(const Buffer *b, int rank, int bytes, int64_t lane, const Buffer *first) {
    int64_t size = product_of(b->dims + b->rank - rank, rank);
    return (char *)b->data + number_in(b, rank, lane, first) * size * bytes;
}

static Equations equations(Buffer **b, int64_t lane, const Buffer *first) {
    double *at[BRANCH];
    for (int i = 0; i < BRANCH; ++i) at[i] = (double *)array_in(b[i], RANKS[i], 8, lane, first);
    return (Equations){at[0], at[1], at[2], at[3], at[4], at[5], at[6]};
}

/* Room for the replay of one lane, in one piece; NULL where there is no memory. */
static char *room(Replay *p) {
    size_t m = (size_t)p->m, k = (size_t)p->k, n = (size_t)p->n, count = (size_t)p->count;
    size_t tableaux = 1 + (count + SNAPSHOT - 1) / SNAPSHOT + SNAPSHOT;
    size_t reals = tableaux * m * m + 6 * m + n + count * (2 * m + k + n) + 4 * m;
    char *memory = malloc(reals * sizeof(double) + count * (sizeof(Step) + m) + n), *end = memory;
    if (memory == NULL) return NULL;
#define TAKE(type, many) ((type *)(end += (many) * sizeof(type)) - (many))
    p->steps = TAKE(Step, count);
    p->T = TAKE(double, m * m), p->kept = TAKE(double, (tableaux - 1) * m * m);
    p->answer = TAKE(double, m), p->rate = TAKE(double, m), p->held = TAKE(double, m);
    p->row = TAKE(double, m), p->share = TAKE(double, m), p->sigma = TAKE(double, n);
    p->spare = TAKE(double, 4 * m);
    for (size_t e = 0; e < count; ++e) {
        Step *s = &p->steps[e];
        s->found = TAKE(double, m), s->velocity = TAKE(double, m);
        s->sigma = TAKE(double, k), s->reaction = TAKE(double, n);
    }
    for (size_t e = 0; e < count; ++e) p->steps[e].moves = TAKE(unsigned char, m);
    p->open = TAKE(unsigned char, n);
    return memory;
}

/* Derivatives of many lanes: tangents of the branch forward, or cotangents of the vertices back. */
static void *replayed(CallFrame *frame, int back) {
    if (asks_version(frame)) return NULL;
    Buffer **in = frame->args.buffers, **out = frame->rets.buffers, **more = in + GIVEN;
    const Buffer *first = out[0];
    int64_t axes = first->rank - (back ? 2 : 1), lanes = product_of(first->dims, axes);
    int64_t most = in[8]->dims[in[8]->rank - 2], vertices = (back ? more[0] : out[0])->dims[axes];
    for (int64_t i = 0; i < frame->rets.count; ++i)
        memset(out[i]->data, 0, (size_t)product_of(out[i]->dims, out[i]->rank) * sizeof(double));
    unsigned char *taken = malloc((size_t)vertices);
    int64_t lane = 0;
    for (; lane < lanes && taken != NULL; ++lane) {
        Replay p;
        p.m = (int)in[1]->dims[in[1]->rank - 1], p.n = (int)in[4]->dims[in[4]->rank - 1], p.k = p.m - p.n;
        p.at = equations(in, lane, first);
        p.opened = (unsigned char *)array_in(in[7], RANKS[7], BYTES[7], lane, first);
        p.events = (int32_t *)array_in(in[8], RANKS[8], BYTES[8], lane, first);
        p.tau = (double *)array_in(in[9], RANKS[9], BYTES[9], lane, first);
        p.count = *(int32_t *)array_in(in[10], RANKS[10], BYTES[10], lane, first);
        if (p.count > most) p.count = (int)most;
        char *memory = room(&p);
        if (memory == NULL) break;
        double *held = p.spare, *f = held + p.m, *x = f + p.m, *c = x + p.m;
        walk_again(&p);
        if (back) {
            Equations d = equations(out, lane, first);
            memset(taken, 0, (size_t)vertices);
            backward(&p, &d, (double *)array_in(more[0], 1, 8, lane, first),
                     (double *)array_in(more[1], 2, 8, lane, first), held, f, x, c, taken);
        } else {
            Equations d = equations(more, lane, first);
            forward(&p, &d, (double *)array_in(out[0], 1, 8, lane, first),
                    (double *)array_in(out[1], 2, 8, lane, first), held, f, x, c);
        }
        free(memory);
    }
    if (lane < lanes) /* no memory: derivatives that are not known must not pass for zero */
        for (int64_t i = 0; i < frame->rets.count; ++i)
            for (int64_t j = product_of(out[i]->dims, out[i]->rank); j-- > 0;) ((double *)out[i]->data)[j] = NAN;
    free(taken);
    return NULL;
}

API void *jbeamshell_replay_forward(CallFrame *frame) { return replayed(frame, 0); }

API void *jbeamshell_replay_backward(CallFrame *frame) { return replayed(frame, 1); }
