/* Derivatives of load paths: tangents of their levels forward, cotangents of their numbers back.

   The path is walked again and its parts are kept.  Between two events the contact changes with the
   load at a rate that solves linear equations, and at an event one of its rows vanishes.  So the
   change at a vertex is the sum of the rates times the steps of the load,

       q = sum rate_e (tau_e - tau_e-1),

   and its derivative needs those of the rates and of the loads of the events alone.  A rate's
   equations are solved by the exchanges that the walk found.  What is read on the spline is
   differentiated as walk.c has it.  Each ``..._back`` is the transpose of its ``..._forth``. */

#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "walk.h"

/* Tangents or cotangents: of the numbers of a path, of its levels, of a contact, of a polygon. */
typedef struct { double *K, *f, *x, *mu, *c, *v, *r, *lift, *start, *loads; } Numbers;
typedef struct { double *v, *r_t, *r_n, *displacement, *lift, *work; } Seen;
typedef struct { double *v, *r, *lift, *extra, *extra_before, load, displacement, length, done, work; } Change;
typedef struct {
    double *at, *change, *along, *pulled, *rise, *whole, *before, *behind, *reach, *ahead, *share;
} Spline;

/* Events of a part, and the rates between them; rates along the edges of the polygon. */
typedef struct {
    Product product;
    int *length;           /* (events,) exchanges before each event */
    double *found, *rate;  /* (events, m) change at an event, and its rate before */
    double *sigma, *by_mu; /* (events, k) sides of the slip, and slope of a rate's equation to mu */
    double *reaction, *slope;
    unsigned char *moves;  /* (events, m) */
    double *along;         /* (vertices, m) */
} Edges;

typedef struct {
    const Walk *w;
    const Part *part;
    Edges edges;
    Spline spline;
    double *pull, *extra, back;       /* change of the branch's equations */
    double *a, *b, *q, *y;            /* (m,) */
    Contact at;                       /* contact at a level */
    double *change;
    unsigned char *flags;             /* (m,) */
    int rounded;
} Bench;

static void add(double *R a, double factor, const double *R b, int m) {
    for (int r = 0; r < m; ++r) a[r] += factor * b[r];
}

/* --- events ------------------------------------------------------------------------------------ */

/* Branch of a part as it was, in the walk. */
static void restore(Walk *w, const Part *part, const double *f, int rounded) {
    const Contact *from = &part->from;
    w->number = part->number, w->at = part->at, w->change = part->change, w->force = part->force;
    w->before = part->before, w->after = part->after, w->node = part->node, w->way = part->way;
    memcpy(w->r_0, from->r, w->m * sizeof(double));
    memcpy(w->lift, from->lift, w->n * sizeof(double));
    for (int r = 0; r < w->m; ++r) w->pull[r] = part->course.sense * f[r];
    for (int i = 0; i < w->n; ++i) w->lifted[i] = from->lift[i] > 0.0;
    w->back = part->course.first ? from->length : INFINITY;
    corners(w, rounded);
}

static int row_of(const Walk *w, const Event *e) { return e->node < w->k ? e->node : w->k - 1; }

static double side_of(const Event *e) { return e->kind == ALONG ? 1.0 : e->kind == AGAINST ? -1.0 : 0.0; }

/* Place of the extra friction that an event waited for, or -1. */
static int extra_of(const Walk *w, const Event *e) {
    return e->kind < STICK && e->tau < w->back ? (e->kind == ALONG ? 0 : w->k) + e->node : -1;
}

/* Goes through the events of a part again. */
static void replay(Walk *w, const Part *part, Edges *g) {
    int k = w->k, m = w->m;
    w->now = &g->product;
    g->product.whole = 1;
    begin(w);
    for (int e = 0; e < part->events; ++e) {
        const Event *event = &part->event[e];
        double *found = g->found + (size_t)e * m, *rate = g->rate + (size_t)e * m;
        unsigned char *free = g->moves + (size_t)e * m;
        advance(w, event->tau);
        g->length[e] = g->product.count;
        for (int r = 0; r < m; ++r) {
            free[r] = moves(w, r);
            found[r] = free[r] ? w->answer[r] : w->held[r], rate[r] = free[r] ? w->rate[r] : 0.0;
        }
        memcpy(g->sigma + (size_t)e * k, w->sigma, k * sizeof(double));
        for (int i = 0; i < k; ++i)
            g->by_mu[(size_t)e * k + i] = w->open[i] ? 0.0 : w->sigma[i] * w->rate[k + i];
        if (event->kind == KINDS) break;
        int q = k + event->node, t = row_of(w, event);
        g->reaction[e] = w->open[event->node] ? w->held[q] : w->answer[q];
        g->slope[e] = event->kind < STICK ? w->mu * w->rate[q] + side_of(event) * w->rate[t] : w->rate[q];
        if (e + 1 < part->events) change_contact(w, event->kind, event->node, event->keep);
    }
    for (int j = 0; j + 1 < w->number; ++j) {
        double *along = g->along + (size_t)j * m, step = w->at[j + 1] - w->at[j];
        const double *q = w->change + (size_t)j * m;
        for (int r = 0; r < m; ++r) along[r] = (q[r + m] - q[r]) / step;
    }
    memset(g->along + (size_t)(w->number - 1) * m, 0, m * sizeof(double));
}

/* Row combination (m,) of the tableau after some exchanges, by ``c`` (m,) on the rows that move. */
static void combined(const Product *p, int count, int m, double *R c, double *R out, unsigned char *R known) {
    memset(out, 0, m * sizeof(double)), memset(known, 0, m);
    for (int e = count - 1; e >= 0; --e) {
        int i = p->row[e], q = p->normal[e];
        double value = dot(c, p->share[e], m), own = c[i];
        if (!known[i]) known[i] = 1, out[i] = value;
        c[q] += p->rest[e] * own;
        c[i] = -value;
        c[q] -= p->add[e] * value;
    }
}

static void events_forth(Bench *z, const Numbers *d, const Change *from, int stiffens) {
    const Walk *w = z->w;
    const Edges *g = &z->edges;
    int k = w->k, m = w->m;
    double now = 0.0, tau = 0.0, mu = *d->mu, *R q = z->q, *R a = z->a;
    memset(q, 0, m * sizeof(double));
    memset(z->spline.change, 0, m * sizeof(double)), z->spline.at[0] = 0.0;
    for (int e = 0; e < z->part->events; ++e) {
        const Event *event = &z->part->event[e];
        const double *R rate = g->rate + (size_t)e * m, *found = g->found + (size_t)e * m;
        const unsigned char *free = g->moves + (size_t)e * m;
        double step = event->tau - now, next = 0.0;
        if (step > 0.0) {
            for (int r = 0; r < m; ++r) a[r] = -z->pull[r];
            for (int r = 0; r < m && stiffens; ++r) a[r] += dot(d->K + (size_t)r * m, rate, m);
            for (int i = 0; i < k; ++i) a[i] += g->by_mu[(size_t)e * k + i] * mu;
            for (int i = 0; i < g->length[e]; ++i) exchanged(&g->product, i, m, a);
            for (int r = 0; r < m; ++r)
                if (free[r]) q[r] += step * a[r];
        }
        add(q, -tau, rate, m);
        if (event->cause == BY_ROW) {
            int rows[2] = {k + event->node, row_of(w, event)};
            double part[2] = {event->kind == CLOSE ? 0.0 : event->kind < STICK ? w->mu : 1.0, side_of(event)};
            double room = event->kind == CLOSE ? from->lift[event->node] + q[rows[0]] : 0.0;
            for (int i = 0; i < 2; ++i) {
                size_t line = (size_t)rows[i] * m;
                if (part[i] == 0.0) continue;
                double force = from->r[rows[i]] - z->pull[rows[i]] * event->tau + dot(w->K + line, q, m);
                room += part[i] * (force + (stiffens ? dot(d->K + line, found, m) : 0.0));
            }
            if (event->kind < STICK) room += mu * g->reaction[e];
            if (extra_of(w, event) >= 0) room += z->extra[extra_of(w, event)];
            next = -room / g->slope[e];
        } else if (event->cause == AT_ONCE) next = tau;
        else if (event->cause == AT_RETURN) next = z->back;
        add(q, next, rate, m);
        tau = next, now = event->tau;
        if (event->vertex > 0) {
            z->spline.at[event->vertex] = tau;
            memcpy(z->spline.change + (size_t)event->vertex * m, q, m * sizeof(double));
        }
    }
}

static void events_back(Bench *z, Numbers *d, Change *from) {
    const Walk *w = z->w;
    const Edges *g = &z->edges;
    int k = w->k, m = w->m, taken = z->part->number;
    double tau = 0.0, *R q = z->q, *R a = z->a, *R b = z->b;
    memset(q, 0, m * sizeof(double));
    for (int e = z->part->events - 1; e >= 0; --e) {
        const Event *event = &z->part->event[e];
        const double *R rate = g->rate + (size_t)e * m, *found = g->found + (size_t)e * m;
        const unsigned char *free = g->moves + (size_t)e * m;
        double step = event->tau - (e > 0 ? event[-1].tau : 0.0);
        if (event->vertex > 0 && event->vertex < taken) { /* the last event at a vertex made it */
            taken = event->vertex, tau += z->spline.at[taken];
            add(q, 1.0, z->spline.change + (size_t)taken * m, m);
        }
        double next = tau + dot(q, rate, m);
        tau = event->cause == AT_ONCE ? next : 0.0;
        if (event->cause == AT_RETURN) z->back += next;
        if (event->cause == BY_ROW) {
            int rows[2] = {k + event->node, row_of(w, event)};
            double part[2] = {event->kind == CLOSE ? 0.0 : event->kind < STICK ? w->mu : 1.0, side_of(event)};
            double room = -next / g->slope[e];
            if (event->kind == CLOSE) from->lift[event->node] += room, q[rows[0]] += room;
            for (int i = 0; i < 2; ++i) {
                size_t line = (size_t)rows[i] * m;
                double force = part[i] * room;
                if (force == 0.0) continue;
                from->r[rows[i]] += force, z->pull[rows[i]] -= event->tau * force;
                add(q, force, w->K + line, m), add(d->K + line, force, found, m);
            }
            if (event->kind < STICK) *d->mu += g->reaction[e] * room;
            if (extra_of(w, event) >= 0) z->extra[extra_of(w, event)] += room;
        }
        tau -= dot(q, rate, m);
        if (!(step > 0.0)) continue;
        for (int r = 0; r < m; ++r) b[r] = free[r] ? step * q[r] : 0.0;
        combined(&g->product, g->length[e], m, b, a, z->flags);
        for (int r = 0; r < m; ++r) b[r] = -(a[r] = free[r] ? a[r] : 0.0);
        for (int i = 0; i < k; ++i) {
            b[k + i] -= g->sigma[(size_t)e * k + i] * w->mu * a[i];
            *d->mu -= g->by_mu[(size_t)e * k + i] * a[i];
        }
        for (int r = 0; r < m; ++r) {
            if (b[r] == 0.0) continue;
            z->pull[r] -= b[r];
            add(d->K + (size_t)r * m, b[r], rate, m);
        }
    }
}

/* --- extra friction ---------------------------------------------------------------------------- */

static void extra_forth(Bench *z, const Numbers *d, const Change *from) {
    const Course *course = &z->part->course;
    int k = z->w->k;
    memset(z->extra, 0, 2 * k * sizeof(double));
    if (z->rounded && course->again) memcpy(z->extra, from->extra_before, 2 * k * sizeof(double));
    else if (z->rounded && course->turns)
        for (int i = 0; i < k; ++i) {
            Extra s = extra_at(z->w, &z->part->from, i);
            z->extra[s.place] = s.mu * *d->mu + s.r_t * from->r[i] + s.r_n * from->r[k + i];
        }
}

static void extra_back(Bench *z, Numbers *d, Change *from) {
    const Course *course = &z->part->course;
    int k = z->w->k;
    if (z->rounded && course->again) add(from->extra_before, 1.0, z->extra, 2 * k);
    else if (z->rounded && course->turns)
        for (int i = 0; i < k; ++i) {
            Extra s = extra_at(z->w, &z->part->from, i);
            double more = z->extra[s.place];
            *d->mu += s.mu * more, from->r[i] += s.r_t * more, from->r[k + i] += s.r_n * more;
        }
}

/* --- spline ------------------------------------------------------------------------------------ */

/* Slopes of the parts of a corner to what they follow from, see `corners` in walk.c: both parts to
   the half before and to what lies ahead, the half to its load, to the reach of this vertex and of
   the one before, and to what lies ahead. */
typedef struct { double before_half, before_ahead, behind_half, behind_ahead, load, reach, earlier, ahead; } Corner;

static Corner corner_of(const Walk *w, int j, int first, const double *reach, const double *ahead) {
    Corner s = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
    if (!(w->part_before[j] > 0.0 && w->part_behind[j] > 0.0)) return s;
    double half, further = ahead[j], part = j > first ? STARTS : 1.0;
    if (w->before[j] == 0) {
        half = fmin(part * w->at[j], further);
        if (part * w->at[j] < further) s.load = part;
        else s.ahead = 1.0;
    } else {
        double earlier = UNEVEN * reach[w->before[j]];
        half = fmin(reach[j], earlier);
        if (reach[j] < earlier) s.reach = 1.0;
        else s.earlier = UNEVEN;
    }
    int ends = w->after[j] == 0;
    if (ends) further = half;
    if (half < UNEVEN * further) s.before_half = 1.0;
    else s.before_ahead = UNEVEN;
    if (further < UNEVEN * half) s.behind_ahead = 1.0;
    else s.behind_half = UNEVEN;
    if (ends) s.before_half += s.before_ahead, s.behind_half += s.behind_ahead, s.before_ahead = s.behind_ahead = 0.0;
    return s;
}

/* Slopes of a vertex's share of a step to the lengths of the elements below and above its node. */
static void share_slopes(const Walk *w, int j, double *below, double *above) {
    int i = w->node[j];
    double a, b, part, way = w->way[j] ? 1.0 : -1.0;
    *below = *above = 0.0;
    if (!(i > 0 && i < w->places - 1)) return;
    a = fabs(w->x[i] - w->x[i - 1]), b = fabs(w->x[i + 1] - w->x[i]), part = b / (a + b);
    part = w->way[j] ? part : 1.0 - part;
    if (!(a + b > 0.0) || part <= 1.0 - MOST_PART || part >= MOST_PART) return;
    *below = -way * b / ((a + b) * (a + b)) * (w->x[i] > w->x[i - 1] ? 1.0 : -1.0);
    *above = way * a / ((a + b) * (a + b)) * (w->x[i + 1] > w->x[i] ? 1.0 : -1.0);
}

/* Reach of each vertex's step that is nearer to it, and what of the next step is: of the walk. */
static void reaches(const Walk *w, double *reach, double *ahead) {
    for (int j = 0; j < w->number; ++j) {
        int b = w->before[j], a = w->after[j];
        reach[j] = (w->at[j] - w->at[b]) * share_of(w, j);
        ahead[j] = (w->at[a] - w->at[j]) * (1.0 - share_of(w, a));
    }
}

static void spline_forth(Bench *z, const Numbers *d) {
    const Walk *w = z->w;
    Spline *s = &z->spline;
    int m = w->m, last = w->number - 1, first = first_front(w);
    for (int j = 0; j <= last; ++j) {
        double below, above;
        int i = w->node[j];
        share_slopes(w, j, &below, &above);
        s->share[j] = 0.0;
        if (below != 0.0 || above != 0.0)
            s->share[j] = below * (d->x[i] - d->x[i - 1]) + above * (d->x[i + 1] - d->x[i]);
    }
    reaches(w, s->reach, s->ahead);
    for (int j = 0; j <= last; ++j) {
        Corner c = corner_of(w, j, first, s->reach, s->ahead);
        int b = w->before[j], e = w->before[b], a = w->after[j];
        double own = (s->at[j] - s->at[b]) * share_of(w, j) + (w->at[j] - w->at[b]) * s->share[j];
        double earlier = (s->at[b] - s->at[e]) * share_of(w, b) + (w->at[b] - w->at[e]) * s->share[b];
        double ahead = (s->at[a] - s->at[j]) * (1.0 - share_of(w, a)) - (w->at[a] - w->at[j]) * s->share[a];
        double half = c.load * s->at[j] + c.reach * own + c.earlier * earlier + c.ahead * ahead;
        s->before[j] = c.before_half * half + c.before_ahead * ahead;
        s->behind[j] = c.behind_half * half + c.behind_ahead * ahead;
    }
    for (int j = 0; j <= last; ++j) {
        const double *q = w->change + (size_t)j * m;
        s->pulled[j] = dot(s->change + (size_t)j * m, w->pull, m) + dot(q, z->pull, m);
    }
    s->whole[0] = 0.0, s->rise[last] = 0.0;
    memset(s->along + (size_t)last * m, 0, m * sizeof(double));
    for (int j = 0; j < last; ++j) {
        double step = w->at[j + 1] - w->at[j], more = s->at[j + 1] - s->at[j];
        const double *R along = z->edges.along + (size_t)j * m, *R q = s->change + (size_t)j * m;
        for (int r = 0; r < m; ++r) s->along[(size_t)j * m + r] = (q[r + m] - q[r] - along[r] * more) / step;
        s->rise[j] = (s->pulled[j + 1] - s->pulled[j] - w->rise[j] * more) / step;
        s->whole[j + 1] = s->whole[j] + 0.5 * more * (w->pulled[j] + w->pulled[j + 1]) +
                          0.5 * step * (s->pulled[j] + s->pulled[j + 1]);
    }
}

static void spline_back(Bench *z, Numbers *d) {
    const Walk *w = z->w;
    Spline *s = &z->spline;
    int m = w->m, last = w->number - 1, first = first_front(w);
    double whole = 0.0;
    for (int j = last - 1; j >= 0; --j) {
        double step = w->at[j + 1] - w->at[j];
        const double *R along = z->edges.along + (size_t)j * m;
        double *R turned = s->along + (size_t)j * m, *R q = s->change + (size_t)j * m;
        whole += s->whole[j + 1];
        double pulled = 0.5 * step * whole - s->rise[j] / step;
        double more = 0.5 * whole * (w->pulled[j] + w->pulled[j + 1]) - s->rise[j] * w->rise[j] / step;
        more -= dot(turned, along, m) / step;
        s->pulled[j] += pulled, s->pulled[j + 1] += 0.5 * step * whole + s->rise[j] / step;
        for (int r = 0; r < m; ++r) q[r] -= turned[r] / step, q[r + m] += turned[r] / step;
        s->at[j + 1] += more, s->at[j] -= more;
    }
    for (int j = 0; j <= last; ++j) {
        add(s->change + (size_t)j * m, s->pulled[j], w->pull, m);
        add(z->pull, s->pulled[j], w->change + (size_t)j * m, m);
    }
    reaches(w, s->reach, s->ahead);
    memset(s->share, 0, (size_t)(last + 1) * sizeof(double));
    for (int j = 0; j <= last; ++j) {
        Corner c = corner_of(w, j, first, s->reach, s->ahead);
        int b = w->before[j], e = w->before[b], a = w->after[j];
        double half = c.before_half * s->before[j] + c.behind_half * s->behind[j];
        double ahead = c.before_ahead * s->before[j] + c.behind_ahead * s->behind[j] + c.ahead * half;
        double own = c.reach * half, earlier = c.earlier * half;
        s->at[j] += c.load * half + own * share_of(w, j) - ahead * (1.0 - share_of(w, a));
        s->at[b] += earlier * share_of(w, b) - own * share_of(w, j);
        s->at[e] -= earlier * share_of(w, b);
        s->at[a] += ahead * (1.0 - share_of(w, a));
        s->share[j] += own * (w->at[j] - w->at[b]);
        s->share[b] += earlier * (w->at[b] - w->at[e]);
        s->share[a] -= ahead * (w->at[a] - w->at[j]);
    }
    for (int j = 0; j <= last; ++j) {
        double below, above;
        int i = w->node[j];
        share_slopes(w, j, &below, &above);
        if (below == 0.0 && above == 0.0) continue;
        below *= s->share[j], above *= s->share[j];
        d->x[i] += below - above, d->x[i - 1] -= below, d->x[i + 1] += above;
    }
}

/* Change y (m,) of the fields at a load; returns that of the load's work on them. */
static double read_forth(Bench *z, double tau, double more, double *R y) {
    const Walk *w = z->w;
    const Spline *s = &z->spline;
    int m = w->m, edge = edge_of(w, tau);
    double since = tau - w->at[edge], later = more - s->at[edge];
    memcpy(y, s->change + (size_t)edge * m, m * sizeof(double));
    add(y, since, s->along + (size_t)edge * m, m), add(y, later, z->edges.along + (size_t)edge * m, m);
    double under = s->whole[edge] + later * (w->pulled[edge] + w->rise[edge] * since) +
                   since * (s->pulled[edge] + 0.5 * s->rise[edge] * since);
    for (int j = 1; j < w->number - 1; ++j) {
        Round o = round_at(tau - w->at[j], w->part_before[j], w->part_behind[j]);
        if (!o.counts) continue;
        double load = more - s->at[j], kink = w->rise[j] - w->rise[j - 1];
        under += o.area * (s->rise[j] - s->rise[j - 1]);
        under += kink * (o.value * load + o.area_before * s->before[j] + o.area_behind * s->behind[j]);
        if (!o.inside) continue;
        double turn = o.load * load + o.before * s->before[j] + o.behind * s->behind[j];
        add(y, turn, z->edges.along + (size_t)j * m, m), add(y, -turn, z->edges.along + (size_t)(j - 1) * m, m);
        add(y, o.value, s->along + (size_t)j * m, m), add(y, -o.value, s->along + (size_t)(j - 1) * m, m);
    }
    return under;
}

/* Cotangent of the load, from those of the fields y (m,) and of the load's work. */
static double read_back(Bench *z, double tau, const double *R y, double under) {
    const Walk *w = z->w;
    Spline *s = &z->spline;
    int m = w->m, edge = edge_of(w, tau);
    double since = tau - w->at[edge];
    double later = dot(y, z->edges.along + (size_t)edge * m, m) + under * (w->pulled[edge] + w->rise[edge] * since);
    double more = later;
    add(s->change + (size_t)edge * m, 1.0, y, m), add(s->along + (size_t)edge * m, since, y, m);
    s->at[edge] -= later, s->whole[edge] += under;
    s->pulled[edge] += since * under, s->rise[edge] += 0.5 * since * since * under;
    for (int j = 1; j < w->number - 1; ++j) {
        Round o = round_at(tau - w->at[j], w->part_before[j], w->part_behind[j]);
        if (!o.counts) continue;
        double kink = under * (w->rise[j] - w->rise[j - 1]), load = kink * o.value;
        s->rise[j] += o.area * under, s->rise[j - 1] -= o.area * under;
        s->before[j] += kink * o.area_before, s->behind[j] += kink * o.area_behind;
        if (o.inside) {
            const double *R along = z->edges.along + (size_t)(j - 1) * m;
            double turn = dot(y, along + m, m) - dot(y, along, m);
            load += o.load * turn;
            s->before[j] += o.before * turn, s->behind[j] += o.behind * turn;
            add(s->along + (size_t)j * m, o.value, y, m), add(s->along + (size_t)(j - 1) * m, -o.value, y, m);
        }
        more += load, s->at[j] -= load;
    }
    return more;
}

/* --- levels ------------------------------------------------------------------------------------ */

/* True for a force that was set to zero, because its node is open. */
static int cleared(const Bench *z, int r) {
    int i = r < z->w->k ? r : r - z->w->k;
    return z->at.lift[i] > 0.0 && z->at.r[r] == 0.0;
}

/* Contact at a load that changes by ``more``: its change without memory; returns that of the work. */
static double level_forth(Bench *z, const Numbers *d, const Change *from, double load, double more, int stiffens, Change *to) {
    const Walk *w = z->w;
    const Course *course = &z->part->course;
    int k = w->k, n = w->n, m = w->m;
    double tau = course->sense * (load - z->part->from.load), *R y = z->y, *R change = z->change;
    double later = course->sense * (more - from->load);
    level(w, &z->part->from, course, load, change, &z->at, z->flags);
    double under = read_forth(z, tau, later, y), moved = dot(y, w->pull, m) + dot(change, z->pull, m), stored = 0.0;
    for (int r = 0; r < m; ++r) {
        const double *line = d->K + (size_t)r * m;
        double force = from->r[r] - tau * z->pull[r] + (stiffens ? dot(line, change, m) : 0.0);
        stored += change[r] * (force - 0.5 * (stiffens ? dot(line, change, m) : 0.0)) + y[r] * z->at.r[r];
        force += dot(w->K + (size_t)r * m, y, m) - later * w->pull[r];
        to->r[r] = cleared(z, r) ? 0.0 : force;
    }
    for (int i = 0; i < k; ++i) to->v[i] = from->v[i] + y[i];
    for (int i = 0; i < n; ++i) to->lift[i] = from->lift[i] + y[k + i];
    to->load = more;
    to->displacement = from->displacement + *d->c * (load - z->part->from.load) + w->c * (more - from->load);
    to->displacement += course->sense * moved;
    return later * dot(change, w->pull, m) - under - stored;
}

/* Cotangent of the load, from those of a contact at it and of the work. */
static double level_back(Bench *z, Numbers *d, Change *from, double load, const Change *to, double work) {
    const Walk *w = z->w;
    const Course *course = &z->part->course;
    int k = w->k, n = w->n, m = w->m;
    double tau = course->sense * (load - z->part->from.load), moved = course->sense * to->displacement;
    double *R y = z->y, *R change = z->change, *R force = z->a, later;
    level(w, &z->part->from, course, load, change, &z->at, z->flags);
    for (int r = 0; r < m; ++r) force[r] = cleared(z, r) ? 0.0 : to->r[r];
    for (int r = 0; r < m; ++r) y[r] = (r < k ? to->v[r] : to->lift[r - k]) + moved * w->pull[r] - work * z->at.r[r];
    for (int r = 0; r < m; ++r) {
        double more = force[r] - 0.5 * work * change[r];
        from->r[r] += force[r] - work * change[r];
        z->pull[r] += moved * change[r] + tau * (work * change[r] - force[r]);
        if (more != 0.0) add(d->K + (size_t)r * m, more, change, m);
        if (force[r] != 0.0) add(y, force[r], w->K + (size_t)r * m, m);
    }
    for (int i = 0; i < k; ++i) from->v[i] += to->v[i];
    for (int i = 0; i < n; ++i) from->lift[i] += to->lift[i];
    later = read_back(z, tau, y, -work) + work * dot(change, w->pull, m) - dot(force, w->pull, m);
    *d->c += (load - z->part->from.load) * to->displacement;
    from->displacement += to->displacement;
    from->load -= w->c * to->displacement + course->sense * later;
    return w->c * to->displacement + course->sense * later;
}

/* --- parts of a path --------------------------------------------------------------------------- */

static int begins_branch(const Tape *tape, int i) {
    return i == 0 || tape->parts[i].target != tape->parts[i - 1].target;
}

static void part_forth(Bench *z, int starts, const double *loads, const Numbers *d, Change *from, Change *to, Change *seen, Seen out) {
    const Part *part = z->part;
    const Course *course = &part->course;
    int k = z->w->k, n = z->w->n, m = z->w->m, stiffens = 0;
    for (size_t i = 0; i < (size_t)m * m && !stiffens; ++i) stiffens = d->K[i] != 0.0;
    for (int r = 0; r < m; ++r) z->pull[r] = course->sense * d->f[r];
    z->back = course->first ? from->length : 0.0;
    extra_forth(z, d, from);
    events_forth(z, d, from, stiffens);
    spline_forth(z, d);
    if (starts) from->done = from->work = 0.0;
    for (int l = part->begin; l < part->end; ++l) {
        double work = from->done + level_forth(z, d, from, loads[l], d->loads[l], stiffens, seen);
        memcpy(out.v + (size_t)l * k, seen->v, k * sizeof(double));
        memcpy(out.r_t + (size_t)l * k, seen->r, k * sizeof(double));
        memcpy(out.r_n + (size_t)l * n, seen->r + k, n * sizeof(double));
        memcpy(out.lift + (size_t)l * n, seen->lift, n * sizeof(double));
        out.displacement[l] = seen->displacement, out.work[l] = work - from->work;
        from->work = work;
    }
    double end = course->splits ? from->load + course->sense * from->length : d->loads[part->target];
    to->done = from->done + level_forth(z, d, from, course->end, end, stiffens, to), to->work = from->work;
    to->length = (course->goes_on ? from->length : 0.0) + course->sense * (to->load - from->load);
    memcpy(to->extra, course->goes_on ? from->extra : z->extra, 2 * k * sizeof(double));
    memcpy(to->extra_before, course->goes_on ? from->extra_before : from->extra, 2 * k * sizeof(double));
}

/* Cotangents of the contact where a part begins, from those where it ends and of its levels. */
static void part_back(Bench *z, int starts, const double *loads, Numbers *d, Change *from, const Change *to, Change *seen, Seen in) {
    const Part *part = z->part;
    const Course *course = &part->course;
    Spline *s = &z->spline;
    int k = z->w->k, n = z->w->n, m = z->w->m;
    size_t v = (size_t)part->number;
    double *lines[] = {s->at, s->pulled, s->rise, s->whole, s->before, s->behind};
    for (int i = 0; i < 6; ++i) memset(lines[i], 0, v * sizeof(double));
    memset(s->change, 0, v * m * sizeof(double)), memset(s->along, 0, v * m * sizeof(double));
    memset(z->pull, 0, m * sizeof(double)), memset(z->extra, 0, 2 * k * sizeof(double)), z->back = 0.0;
    memset(from->v, 0, k * sizeof(double)), memset(from->r, 0, m * sizeof(double));
    memset(from->lift, 0, n * sizeof(double));

    int goes_on = course->goes_on;
    for (int i = 0; i < 2 * k; ++i) {
        from->extra[i] = goes_on ? to->extra[i] : to->extra_before[i];
        from->extra_before[i] = goes_on ? to->extra_before[i] : 0.0;
        if (!goes_on) z->extra[i] += to->extra[i];
    }
    from->displacement = 0.0, from->done = to->done, from->load = -course->sense * to->length;
    from->length = goes_on ? to->length : 0.0;
    double end = to->load + course->sense * to->length + level_back(z, d, from, course->end, to, to->done);
    if (course->splits) from->load += end, from->length += course->sense * end;
    else d->loads[part->target] += end;
    for (int l = part->end - 1; l >= part->begin; --l) {
        double work = in.work[l] - (l < part->target ? in.work[l + 1] : 0.0);
        memcpy(seen->v, in.v + (size_t)l * k, k * sizeof(double));
        memcpy(seen->r, in.r_t + (size_t)l * k, k * sizeof(double));
        memcpy(seen->r + k, in.r_n + (size_t)l * n, n * sizeof(double));
        memcpy(seen->lift, in.lift + (size_t)l * n, n * sizeof(double));
        seen->displacement = in.displacement[l], from->done += work;
        d->loads[l] += level_back(z, d, from, loads[l], seen, work);
    }
    if (starts) from->done = 0.0;
    spline_back(z, d);
    events_back(z, d, from);
    extra_back(z, d, from);
    if (course->first) from->length += z->back;
    add(d->f, course->sense, z->pull, m);
}

/* --- room -------------------------------------------------------------------------------------- */

static Change change_in(Room *room, int k, int n) {
    Change c = {.load = 0.0};
    c.v = REALS(k), c.r = REALS(k + n), c.lift = REALS(n), c.extra = REALS(2 * k), c.extra_before = REALS(2 * k);
    return c;
}

static Levels levels_in(Room *room, int levels, int k, int n) {
    Levels l;
    size_t many = (size_t)levels;
    l.v = REALS(many * k), l.r_t = REALS(many * k), l.r_n = REALS(many * n), l.displacement = REALS(many);
    l.lift = REALS(many * n), l.work = REALS(many), l.slipping = FLAGS(many * k), l.settled = FLAGS(many);
    return l;
}

static void bench_in(Room *room, Bench *z, int k, int n, size_t e, size_t v) {
    int m = k + n;
    Edges *g = &z->edges;
    Spline *s = &z->spline;
    product_in(room, &g->product, (int)e + 2 * n);
    g->length = WHOLES(e), g->found = REALS(e * m), g->rate = REALS(e * m), g->sigma = REALS(e * k);
    g->by_mu = REALS(e * k), g->reaction = REALS(e), g->slope = REALS(e), g->moves = FLAGS(e * m);
    g->along = REALS(v * m);
    s->at = REALS(v), s->change = REALS(v * m), s->along = REALS(v * m), s->pulled = REALS(v);
    s->rise = REALS(v), s->whole = REALS(v), s->before = REALS(v), s->behind = REALS(v);
    s->reach = REALS(v), s->ahead = REALS(v), s->share = REALS(v);
    z->pull = REALS(m), z->extra = REALS(2 * k), z->a = REALS(m), z->b = REALS(m), z->q = REALS(m);
    z->y = REALS(m), z->change = REALS(m), z->flags = FLAGS(m), z->at = contact_in(room, k, n);
}

static void forget(Tape *tape) {
    for (int i = 0; i < tape->count; ++i) free(tape->parts[i].memory);
    tape->count = tape->events = tape->failed = 0;
}

/* Tangent of the contact where a path begins; zero for cotangents of where it ends. */
static void set_change(Change *a, const double *v, const double *r, const double *lift, int k, int n) {
    memcpy(a->v, v, k * sizeof(double)), memcpy(a->r, r, (k + n) * sizeof(double));
    memcpy(a->lift, lift, n * sizeof(double));
    memset(a->extra, 0, 2 * k * sizeof(double)), memset(a->extra_before, 0, 2 * k * sizeof(double));
    a->length = a->done = a->work = 0.0;
}

/* Derivatives of lanes that share one path, all of them part by part; 0 without memory. */
static int derive(Desk *desk, const Given *given, int levels, int lanes, Numbers *numbers, Seen *seen, int back) {
    Walk *w = &desk->walk;
    Tape *tape = w->tape;
    int k = w->k, n = w->n, most = 0, vertices = 0, done = 0;
    Room first = {NULL, 0}, whole = {NULL, 0}, *room = &first;
    Levels scrap;
    for (int pass = 0; pass < 2; ++pass) {
        scrap = levels_in(room, levels, k, n);
        if (pass == 0) first.at = malloc(first.used), first.used = 0;
        if (first.at == NULL) return 0;
    }
    run(desk, given, 0, levels, scrap);
    for (int i = 0; i < tape->count; ++i) {
        if (tape->parts[i].events > most) most = tape->parts[i].events;
        if (tape->parts[i].number > vertices) vertices = tape->parts[i].number;
    }
    Bench bench = {.w = w, .rounded = *given->rounded};
    const Walk own = *w; /* whose room the parts' own stands in for */
    Change *states = malloc(2 * (size_t)lanes * sizeof(Change)), one;
    room = &whole;
    for (int pass = 0; pass < 2 && states != NULL && !tape->failed; ++pass) {
        bench_in(room, &bench, k, n, (size_t)most, (size_t)vertices);
        one = change_in(room, k, n);
        for (int i = 0; i < 2 * lanes; ++i) states[i] = change_in(room, k, n);
        if (pass == 0) whole.at = malloc(whole.used), whole.used = 0;
        else done = 1;
        if (whole.at == NULL) break;
    }
    for (int lane = 0; lane < lanes && done; ++lane) {
        Change *at = &states[2 * lane];
        const Numbers *d = &numbers[lane];
        set_change(at, d->v, d->r, d->lift, k, n);
        at->load = d->start[0], at->displacement = d->start[1];
    }
    for (int i = 0; i < tape->count && done; ++i) {
        int number = back ? tape->count - 1 - i : i, starts = begins_branch(tape, number);
        bench.part = &tape->parts[number];
        restore(w, bench.part, given->f, bench.rounded);
        replay(w, bench.part, &bench.edges);
        for (int lane = 0; lane < lanes; ++lane) {
            Change *at = &states[2 * lane + i % 2], *next = &states[2 * lane + 1 - i % 2];
            if (back) part_back(&bench, starts, given->loads, &numbers[lane], next, at, &one, seen[lane]);
            else part_forth(&bench, starts, given->loads, &numbers[lane], at, next, &one, seen[lane]);
        }
    }
    for (int lane = 0; lane < lanes && done && back; ++lane) {
        const Change *at = &states[2 * lane + tape->count % 2];
        Numbers *d = &numbers[lane];
        add(d->v, 1.0, at->v, k), add(d->r, 1.0, at->r, k + n), add(d->lift, 1.0, at->lift, n);
        d->start[0] += at->load, d->start[1] += at->displacement;
    }
    *w = own;
    forget(tape);
    free(states), free(whole.at), free(first.at);
    return done;
}

/* --- handlers for XLA --------------------------------------------------------------------------- */

enum { REAL = 10, SEEN = 6 };
static const int SEEN_RANKS[SEEN] = {2, 2, 2, 1, 2, 1};

static double *reals_of(const Buffer *b, int rank, int64_t lane, const Buffer *first) {
    return (double *)b->data + number_in(b, rank, lane, first) * product_of(b->dims + b->rank - rank, rank);
}

static Numbers numbers_of(Buffer **b, int64_t lane, const Buffer *first) {
    double *at[REAL];
    for (int i = 0; i < REAL; ++i) at[i] = reals_of(b[i], ARGUMENT_RANKS[i], lane, first);
    return (Numbers){at[0], at[1], at[2], at[3], at[4], at[5], at[6], at[7], at[8], at[9]};
}

static Seen seen_of(Buffer **b, int64_t lane, const Buffer *first) {
    double *at[SEEN];
    for (int i = 0; i < SEEN; ++i) at[i] = reals_of(b[i], SEEN_RANKS[i], lane, first);
    return (Seen){at[0], at[1], at[2], at[3], at[4], at[5]};
}

/* Tangents of the levels of many lanes, or cotangents of their numbers; lanes in a row that share
   their path go through it together. */
static void *derived(CallFrame *frame, int back) {
    if (asks_version(frame)) return NULL;
    Buffer **in = frame->args.buffers, **out = frame->rets.buffers, **more = in + ARGUMENTS;
    const Buffer *first = out[0];
    int64_t axes = in[0]->rank - 2, lanes = product_of(first->dims, axes);
    int m = (int)in[1]->dims[axes], n = (int)in[7]->dims[axes], k = m - n, levels = (int)in[9]->dims[axes];
    for (int64_t i = 0; i < frame->rets.count; ++i)
        memset(out[i]->data, 0, (size_t)product_of(out[i]->dims, out[i]->rank) * sizeof(double));
    Desk desk = {.memory = NULL};
    Tape tape = {.count = 0};
    tape.event = malloc((size_t)(MOST_EVENTS * n + 1) * sizeof(Event));
    Numbers *numbers = malloc((size_t)lanes * sizeof(Numbers));
    Seen *seen = malloc((size_t)lanes * sizeof(Seen));
    int fine = tape.event != NULL && numbers != NULL && seen != NULL && open_desk(&desk, k, n, (int)in[2]->dims[axes]);
    desk.walk.tape = &tape;
    for (int64_t lane = 0, next; lane < lanes && fine; lane = next) {
        int64_t own[ARGUMENTS], other[ARGUMENTS];
        Given given = given_of(in, lane, first, own);
        for (next = lane; next < lanes; ++next) {
            given_of(in, next, first, other);
            if (memcmp(own, other, sizeof own) != 0) break;
            numbers[next - lane] = numbers_of(back ? out : more, next, first);
            seen[next - lane] = seen_of(back ? more : out, next, first);
        }
        fine = derive(&desk, &given, levels, (int)(next - lane), numbers, seen, back);
    }
    if (!fine) /* no memory: derivatives that are not known must not pass for zero */
        for (int64_t i = 0; i < frame->rets.count; ++i)
            for (int64_t j = product_of(out[i]->dims, out[i]->rank); j-- > 0;) ((double *)out[i]->data)[j] = NAN;
    close_desk(&desk);
    free(tape.parts), free(tape.event), free(numbers), free(seen);
    return NULL;
}

API void *jbeamshell_slopes_forward(CallFrame *frame) { return derived(frame, 0); }

API void *jbeamshell_slopes_backward(CallFrame *frame) { return derived(frame, 1); }
