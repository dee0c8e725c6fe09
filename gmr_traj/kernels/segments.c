/* Distances between segments, see gmr_traj/collision/segments.py: the same operations in the same order. */

#include <math.h>
#include <stdint.h>

/* Squared lengths and their products below this are zero. */
static const double SMALLEST = 1e-200;

static double dot(const double *x, const double *y) { return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]; }

static void cross(const double *x, const double *y, double *out)
{
    out[0] = x[1] * y[2] - x[2] * y[1];
    out[1] = x[2] * y[0] - x[0] * y[2];
    out[2] = x[0] * y[1] - x[1] * y[0];
}

static double share(double numerator, double denominator)
{
    double ratio = denominator > SMALLEST ? numerator / denominator : 0.0;
    return ratio < 0.0 ? 0.0 : ratio > 1.0 ? 1.0 : ratio;
}

/* Distance of the segments a0-a1 and b0-b1, and where it is attained. */
static double distance(const double *a0, const double *a1, const double *b0, const double *b1, double *s, double *t)
{
    double u[3], v[3], r[3], w[3], rv[3], gap[3];
    for (int k = 0; k < 3; k++) {
        u[k] = a1[k] - a0[k];
        v[k] = b1[k] - b0[k];
        r[k] = b0[k] - a0[k];
    }
    double uu = dot(u, u), vv = dot(v, v), uv = dot(u, v), ur = dot(u, r), vr = dot(v, r);
    cross(u, v, w);
    cross(r, v, rv);
    *s = share(dot(rv, w), dot(w, w));
    *t = share(*s * uv - vr, vv);
    *s = share(*t * uv + ur, uu);
    for (int k = 0; k < 3; k++)
        gap[k] = *s * u[k] - *t * v[k] - r[k];
    return sqrt(dot(gap, gap));
}

/* Whether spheres around two segments, `reach` apart at most, leave it open that these are near. */
static int near(const double *a0, const double *a1, const double *b0, const double *b1, double reach)
{
    double apart = 0.0;
    for (int k = 0; k < 3; k++) {
        double between = 0.5 * (a0[k] + a1[k]) - 0.5 * (b0[k] + b1[k]);
        apart += between * between;
    }
    return apart < reach * reach;
}

typedef struct {
    int64_t frames, pairs;
    const double *starts, *ends; /* (capsules, frames, 3) */
    const int64_t *pair;         /* (pairs, 2) */
    const double *radii;         /* (pairs): sums */
    const double *reach;         /* (pairs): of the spheres */
} Capsules;

/* Frames in which pairs of capsules are closer than the margin, pair after pair, and how close; `counts` says how many
   of each pair.  Returns how many there are, also where there is no room for all of them. */
int64_t segments_close(const Capsules *of, double margin, int64_t room, int64_t *counts, int64_t *frames,
                       double *clearances)
{
    int64_t found = 0;
    for (int64_t p = 0; p < of->pairs; p++) {
        int64_t i = 3 * of->frames * of->pair[2 * p], j = 3 * of->frames * of->pair[2 * p + 1], before = found;
        for (int64_t k = 0; k < of->frames; k++) {
            const double *a0 = of->starts + i + 3 * k, *a1 = of->ends + i + 3 * k;
            const double *b0 = of->starts + j + 3 * k, *b1 = of->ends + j + 3 * k;
            if (!near(a0, a1, b0, b1, of->reach[p]))
                continue;
            double s, t, clearance = distance(a0, a1, b0, b1, &s, &t) - of->radii[p];
            if (!(clearance < margin))
                continue;
            if (found < room) {
                frames[found] = k;
                clearances[found] = clearance;
            }
            found++;
        }
        counts[p] = found - before;
    }
    return found;
}

typedef struct {
    int64_t count, mine, others, pairs;
    const double *points; /* (count, mine, 2, 3) */
    const double *ends;   /* (count, others, 2, 3) */
    const int64_t *pair;  /* (pairs, 2) */
    const double *radii;  /* (pairs): sums */
    const double *reach;  /* (pairs): of the spheres */
} Surroundings;

/* Configurations and pairs that are closer than the margin: their distance, and where on each segment it is attained.
   Returns how many there are. */
int64_t segments_pairs(const Surroundings *around, double margin, int64_t *configurations, int64_t *pairs, double *gap,
                       double *s, double *t)
{
    int64_t found = 0;
    for (int64_t n = 0; n < around->count; n++)
        for (int64_t p = 0; p < around->pairs; p++) {
            const double *a = around->points + (n * around->mine + around->pair[2 * p]) * 6;
            const double *b = around->ends + (n * around->others + around->pair[2 * p + 1]) * 6;
            if (!near(a, a + 3, b, b + 3, around->reach[p]))
                continue;
            double at, there, d = distance(a, a + 3, b, b + 3, &at, &there);
            if (d - around->radii[p] < margin) {
                configurations[found] = n;
                pairs[found] = p;
                gap[found] = d;
                s[found] = at;
                t[found++] = there;
            }
        }
    return found;
}

/* Joints of a limb at most. */
enum { JOINTS = 32 };

/* Add what capsules that are too close contribute: half of the square of `lacking`, its gradient and J'J.

   jacobian: of end points by joints, (configurations, capsules, 2, joints, 3); configuration, ascending, and capsule of
   each of `count` rows; lacking: clearance less the margin, all to be divided by `violation`; share: of the second end
   point; value, hessian, gradient: (configurations), with (joints, joints) and (joints).  Returns whether there was room
   for the joints. */
int64_t segments_rows(int64_t count, int64_t capsules, int64_t joints, double violation, const double *jacobian,
                      const int64_t *configuration, const int64_t *capsule, const double *lacking, const double *normals,
                      const double *share, double *value, double *hessian, double *gradient)
{
    double h[JOINTS][JOINTS], g[JOINTS], v, row[JOINTS];
    if (joints > JOINTS)
        return 0;
    for (int64_t a = 0; a < count;) {
        int64_t n = configuration[a];
        v = 0.0;
        for (int64_t k = 0; k < joints; k++) {
            g[k] = 0.0;
            for (int64_t m = 0; m <= k; m++)
                h[k][m] = 0.0;
        }
        for (; a < count && configuration[a] == n; a++) {
            const double *one = jacobian + (n * capsules + capsule[a]) * 2 * joints * 3, *other = one + joints * 3;
            const double *normal = normals + 3 * a;
            double s = share[a], rest = 1.0 - s, off = lacking[a] / violation;
            for (int64_t k = 0; k < joints; k++) {
                double x = rest * one[3 * k] + s * other[3 * k];
                double y = rest * one[3 * k + 1] + s * other[3 * k + 1];
                double z = rest * one[3 * k + 2] + s * other[3 * k + 2];
                row[k] = (x * normal[0] + y * normal[1] + z * normal[2]) / violation;
            }
            v += off * off;
            for (int64_t k = 0; k < joints; k++) {
                g[k] += row[k] * off;
                for (int64_t m = 0; m <= k; m++)
                    h[k][m] += row[k] * row[m];
            }
        }
        value[n] += 0.5 * v;
        for (int64_t k = 0; k < joints; k++) {
            gradient[n * joints + k] += g[k];
            for (int64_t m = 0; m <= k; m++) {
                hessian[(n * joints + k) * joints + m] += h[k][m];
                if (m < k)
                    hessian[(n * joints + m) * joints + k] += h[k][m];
            }
        }
    }
    return 1;
}
