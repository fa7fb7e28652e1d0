// Tabular Q-learning as one would write it in C: flat arrays, xoshiro256++ in registers, premultiplied rows (4 s + a).
// The same draws, in the same order, as qualrl.kernels.learning.
#include <stdint.h>
static inline uint64_t rotl(uint64_t x, int k) { return (x << k) | (x >> (64 - k)); }
static inline uint64_t draw(uint64_t *r) {
    uint64_t u = rotl(r[0] + r[3], 23) + r[0], t = r[1] << 17;
    r[2] ^= r[0]; r[3] ^= r[1]; r[1] ^= r[2]; r[0] ^= r[3]; r[2] ^= t; r[3] = rotl(r[3], 45);
    return u;
}
int64_t q_learning(const uint32_t *next, int64_t start, int64_t goal, double step_reward, double goal_reward, int64_t n, uint64_t *stream,
                   double *q, double alpha, double gamma, double epsilon, int64_t *steps, double *returns) {
    uint64_t r[4] = {stream[0], stream[1], stream[2], stream[3]};
    const uint64_t explore = epsilon * 4294967296.0;
    uint64_t s = start * 4, first = s, end = goal * 4;
    int64_t t = 0, episode = 0;
    double total = 0;
    for (int64_t i = 0; i < n; i++) {
        uint64_t u = draw(r), a;
        const double q0 = q[s], q1 = q[s + 1], q2 = q[s + 2], q3 = q[s + 3];
        if ((u >> 32) < explore) {
            a = ((u & 0xffffffff) * 4) >> 32;
        } else {
            double best = q0; int ties = 1; a = 0;
            if (q1 > best) { best = q1; a = 1; ties = 1; } else if (q1 == best) ties++;
            if (q2 > best) { best = q2; a = 2; ties = 1; } else if (q2 == best) ties++;
            if (q3 > best) { best = q3; a = 3; ties = 1; } else if (q3 == best) ties++;
            if (ties > 1) {
                int64_t skip = ((u & 0xffffffff) * ties) >> 32;
                for (a = 0;; a++) if (q[s + a] == best && skip-- == 0) break;
            }
        }
        uint64_t at = s + a, s2 = next[at];
        t++;
        if (s2 == end) {
            q[at] += alpha * (goal_reward - q[at]);
            steps[episode] = t; returns[episode++] = total + goal_reward; total = 0; t = 0; s = first;
        } else {
            const double *p = q + s2;
            double x = p[0] > p[1] ? p[0] : p[1], y = p[2] > p[3] ? p[2] : p[3], best = x > y ? x : y;
            q[at] += alpha * (step_reward + gamma * best - q[at]);
            total += step_reward; s = s2;
        }
    }
    return episode;
}
