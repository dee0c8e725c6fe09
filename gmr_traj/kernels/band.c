/* Cholesky factors of fronts, one after the other, and substitutions with them: see gmr_traj/band/cholesky.py, which
   does the same, number for number, where there is no compiler.  BLAS and LAPACK are the routines that SciPy exports. */

#include <stdint.h>
#include <string.h>

/* Numbers of a row of `fronts`. */
enum { PIVOTS, REST, PANEL, VECTOR, ONWARD, ONWARD_AT, FRONT };

/* Numbers of a step of a staircase: columns first <= c < stop, rows of the rest that begin before `stop`. */
enum { FIRST, STOP, DONE, ROWS, STEP };

typedef void potrf(const char *, const int *, double *, const int *, int *);
typedef void trsm(const char *, const char *, const char *, const char *, const int *, const int *, const double *,
                  const double *, const int *, double *, const int *);
typedef void syrk(const char *, const char *, const int *, const int *, const double *, const double *, const int *,
                  const double *, double *, const int *);
typedef void trsv(const char *, const char *, const char *, const int *, const double *, const int *, double *,
                  const int *);
typedef void gemv(const char *, const int *, const int *, const double *, const double *, const int *, const double *,
                  const int *, const double *, double *, const int *);

typedef struct {
    potrf *cholesky;
    trsm *solve_right;
    syrk *downdate;
    trsv *solve_triangle;
    gemv *subtract_product;
} Routines;

typedef struct {
    int64_t count, steps;      /* fronts, and steps of a staircase */
    const int64_t *fronts;     /* (count, FRONT) */
    const int64_t *onward;     /* rows of the next front's rest, of all fronts */
    const int64_t *staircases; /* (count, steps, STEP) */
    double *store, *work;
    const Routines *call;
} Chain;

typedef struct {
    const int64_t *front; /* (count + 1): the first entry of each front */
    const int32_t *place; /* of an entry in its panel */
    const int32_t *first; /* (entries + 1): the first share of each entry */
    const int32_t *share; /* which of the values */
    const double *values;
} Entries;

static const int ONE = 1;
static const double PLUS = 1.0, MINUS = -1.0;

/* Sums of shares, from the first to the last, in a panel that is zero elsewhere. */
void band_assemble(const Entries *entries, int64_t front, double *panel, int64_t size)
{
    memset(panel, 0, size * sizeof(double));
    for (int64_t k = entries->front[front]; k < entries->front[front + 1]; k++) {
        double sum = 0.0;
        for (int32_t s = entries->first[k]; s < entries->first[k + 1]; s++)
            sum += entries->values[entries->share[s]];
        panel[entries->place[k]] = sum;
    }
}

/* What the front before leaves for this one's pivots (the last of its rest) and rest (those before). */
static void extend(const int64_t *before, const int64_t *now, const int64_t *onward, const double *done, double *panel,
                   double *update)
{
    int64_t p = now[PIVOTS], r = now[REST], k = before[ONWARD], q = before[REST];
    for (int64_t j = 0; j < p; j++) {
        double *column = panel + j * (p + r);
        const double *from = done + (k + j) * q + k;
        for (int64_t i = j; i < p; i++)
            column[i] += from[i];
        for (int64_t i = 0; i < k; i++)
            column[p + onward[i]] += done[i * q + k + j];
    }
    for (int64_t j = 0; j < k; j++)
        for (int64_t i = 0; i < k; i++)
            update[onward[j] * r + onward[i]] = done[j * q + i];
}

static void forward(const Chain *chain, const int64_t *before, const int64_t *now)
{
    int p = (int)now[PIVOTS], r = (int)now[REST], h = p + r;
    const double *panel = chain->store + now[PANEL];
    double *x = chain->work + now[VECTOR];
    if (before) {
        const double *done = chain->work + before[VECTOR] + before[PIVOTS];
        const int64_t *onward = chain->onward + before[ONWARD_AT];
        int64_t k = before[ONWARD];
        for (int64_t i = 0; i < p; i++)
            x[i] += done[k + i];
        for (int64_t i = 0; i < k; i++)
            x[p + onward[i]] += done[i];
    }
    chain->call->solve_triangle("L", "N", "N", &p, panel, &h, x, &ONE);
    if (r)
        chain->call->subtract_product("N", &r, &p, &MINUS, panel + p, &h, x, &ONE, &PLUS, x + p, &ONE);
}

/* Factors, with the forward substitution of a right-hand side on the way.  The rest of the last front is left in
   spaces[(count - 1) % 2].  Returns the number of fronts that were definite. */
int64_t band_factor(const Chain *chain, const Entries *entries, double *const *spaces)
{
    const Routines *call = chain->call;
    const int64_t *before = 0;
    for (int64_t f = 0; f < chain->count; f++) {
        const int64_t *now = chain->fronts + f * FRONT;
        int p = (int)now[PIVOTS], r = (int)now[REST], h = p + r, info = 0;
        double *panel = chain->store + now[PANEL], *update = spaces[f % 2];
        band_assemble(entries, f, panel, (int64_t)h * p);
        memset(update, 0, (int64_t)r * r * sizeof(double));
        if (before)
            extend(before, now, chain->onward + before[ONWARD_AT], spaces[(f + 1) % 2], panel, update);
        call->cholesky("L", &p, panel, &h, &info);
        if (info)
            return f;
        const int64_t *steps = chain->staircases + f * chain->steps * STEP;
        for (int64_t s = 0; s < chain->steps; s++) {
            const int64_t *step = steps + s * STEP;
            int width = p - (int)step[FIRST], rows = (int)(step[ROWS] - step[DONE]);
            double *block = panel + p + h * step[FIRST] + step[DONE];
            if (rows > 0)
                call->solve_right("R", "L", "T", "N", &rows, &width, &PLUS, panel + step[FIRST] * (h + 1), &h, block,
                                  &h);
        }
        for (int64_t s = 0; s < chain->steps; s++) {
            const int64_t *step = steps + s * STEP;
            int width = (int)(step[STOP] - step[FIRST]), rows = (int)step[ROWS];
            if (rows > 0 && width > 0)
                call->downdate("L", "N", &rows, &width, &MINUS, panel + p + h * step[FIRST], &h, &PLUS, update, &r);
        }
        forward(chain, before, now);
        before = now;
    }
    return chain->count;
}

void band_forward(const Chain *chain)
{
    for (int64_t f = 0; f < chain->count; f++) {
        const int64_t *now = chain->fronts + f * FRONT;
        forward(chain, f ? now - FRONT : 0, now);
    }
}

/* From the last front, whose rest is known, to the first. */
void band_backward(const Chain *chain)
{
    for (int64_t f = chain->count - 1; f >= 0; f--) {
        const int64_t *now = chain->fronts + f * FRONT;
        int p = (int)now[PIVOTS], r = (int)now[REST], h = p + r;
        const double *panel = chain->store + now[PANEL];
        double *x = chain->work + now[VECTOR];
        if (f + 1 < chain->count) {
            const double *after = chain->work + now[FRONT + VECTOR];
            const int64_t *onward = chain->onward + now[ONWARD_AT];
            int64_t k = now[ONWARD], q = now[FRONT + PIVOTS];
            memcpy(x + p + k, after, q * sizeof(double));
            for (int64_t i = 0; i < k; i++)
                x[p + i] = after[q + onward[i]];
        }
        if (r)
            chain->call->subtract_product("T", &r, &p, &MINUS, panel + p, &h, x + p, &ONE, &PLUS, x, &ONE);
        chain->call->solve_triangle("L", "T", "N", &p, panel, &h, x, &ONE);
    }
}
