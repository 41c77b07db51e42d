/* Algorithms 1 and 2 of Wang's lecture note, as a program for dropspin: cc -O2 -o solver solver.c -lm */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef double Vec[3];
typedef double Mat[3][3];

static double dt, mass, gravity[3], c_linear, c_angular, restitution, friction, rest_speed, radius;
static Mat inertia, inverse_body;
static int has_floor, count;
static Vec *vertices;
static Vec x, v, w;
static double q[4]; /* x, y, z, w */

static void cross(const Vec a, const Vec b, Vec out) {
    Vec c = {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
    memcpy(out, c, sizeof c);
}

static void apply(const Mat m, const Vec a, Vec out) {
    Vec b;
    for (int i = 0; i < 3; i++) b[i] = m[i][0] * a[0] + m[i][1] * a[1] + m[i][2] * a[2];
    memcpy(out, b, sizeof b);
}

static void invert(const Mat m, Mat out) {
    Mat c;
    for (int i = 0; i < 3; i++) cross(m[(i + 1) % 3], m[(i + 2) % 3], c[i]);
    double det = m[0][0] * c[0][0] + m[0][1] * c[0][1] + m[0][2] * c[0][2];
    for (int i = 0; i < 3; i++)
        for (int j = 0; j < 3; j++) out[i][j] = c[j][i] / det;
}

static void rotation_matrix(Mat R) { /* eq 4 */
    double a = q[0], b = q[1], c = q[2], s = q[3];
    Mat m = {{s * s + a * a - b * b - c * c, 2 * (a * b - s * c), 2 * (a * c + s * b)},
             {2 * (a * b + s * c), s * s - a * a + b * b - c * c, 2 * (b * c - s * a)},
             {2 * (a * c - s * b), 2 * (b * c + s * a), s * s - a * a - b * b + c * c}};
    memcpy(R, m, sizeof m);
}

static void collide(void) { /* Algorithm 2 */
    Mat R, inverse = {{0}}, K, K_inverse;
    Vec r = {0, 0, 0}, u, wanted, j, turned;
    int hit = 0;
    rotation_matrix(R);
    for (int i = 0; i < count; i++) { /* eq 10 */
        Vec arm, velocity;
        apply(R, vertices[i], arm);
        arm[1] -= radius; /* the lowest point of a ball about the vertex */
        cross(w, arm, velocity);
        if (x[1] + arm[1] < 0 && v[1] + velocity[1] < 0) {
            for (int k = 0; k < 3; k++) r[k] += arm[k];
            hit++;
        }
    }
    if (!hit) return;
    for (int k = 0; k < 3; k++) r[k] /= hit; /* section 3.2 */
    for (int i = 0; i < 3; i++)              /* eq 7 */
        for (int k = 0; k < 3; k++)
            for (int m = 0; m < 3; m++)
                for (int n = 0; n < 3; n++) inverse[i][k] += R[i][m] * inverse_body[m][n] * R[k][n];
    for (int k = 0; k < 3; k++) { /* eq 15: column k is what a unit impulse along k does to the velocity of the point */
        Vec unit = {k == 0, k == 1, k == 2}, change;
        cross(r, unit, change);
        apply(inverse, change, change);
        cross(change, r, change);
        for (int i = 0; i < 3; i++) K[i][k] = (i == k) / mass + change[i];
    }
    cross(w, r, u);
    for (int k = 0; k < 3; k++) u[k] += v[k];
    double e = fabs(u[1]) < rest_speed ? 0 : restitution;
    for (int k = 0; k < 3; k++) wanted[k] = friction > 0 ? -u[k] : 0; /* eq 17, or eq 11 */
    wanted[1] = -(1 + e) * u[1];
    invert(K, K_inverse);
    apply(K_inverse, wanted, j);
    cross(r, j, turned);
    apply(inverse, turned, turned);
    for (int k = 0; k < 3; k++) v[k] += j[k] / mass, w[k] += turned[k]; /* eq 12 */
}

static void step(void) { /* Algorithm 1 */
    for (int k = 0; k < 3; k++) v[k] = c_linear * (v[k] + dt * gravity[k]), w[k] *= c_angular;
    if (has_floor) collide();
    for (int k = 0; k < 3; k++) x[k] += dt * v[k];
    double d[4], length = 0; /* eq 6: q + dt/2 (w, 0) q */
    cross(w, q, d);
    for (int k = 0; k < 3; k++) d[k] += q[3] * w[k];
    d[3] = -(w[0] * q[0] + w[1] * q[1] + w[2] * q[2]);
    for (int k = 0; k < 4; k++) q[k] += 0.5 * dt * d[k], length += q[k] * q[k];
    for (int k = 0; k < 4; k++) q[k] /= sqrt(length);
}

static void read_numbers(double *out, int n) {
    for (int i = 0; i < n; i++)
        if (scanf("%lf", &out[i]) != 1) exit(2);
}

static void answer(void) {
    printf("%.17g %.17g %.17g %.17g %.17g %.17g %.17g ", x[0], x[1], x[2], q[0], q[1], q[2], q[3]);
    printf("%.17g %.17g %.17g %.17g %.17g %.17g\n", v[0], v[1], v[2], w[0], w[1], w[2]);
    fflush(stdout); /* or the answer stays in this process */
}

int main(void) {
    char word[32];
    double n;
    int known = 0;
    while (scanf("%31s", word) == 1) {
        if (!strcmp(word, "dt")) read_numbers(&dt, 1);
        else if (!strcmp(word, "mass")) read_numbers(&mass, 1);
        else if (!strcmp(word, "inertia")) read_numbers(&inertia[0][0], 9), invert(inertia, inverse_body);
        else if (!strcmp(word, "gravity")) read_numbers(gravity, 3);
        else if (!strcmp(word, "damping")) read_numbers(&c_linear, 1), read_numbers(&c_angular, 1);
        else if (!strcmp(word, "floor")) {
            has_floor = 1;
            read_numbers(&restitution, 1), read_numbers(&friction, 1), read_numbers(&rest_speed, 1);
        } else if (!strcmp(word, "radius")) read_numbers(&radius, 1);
        else if (!strcmp(word, "vertices")) read_numbers(&n, 1), count = n, vertices = calloc(count, sizeof(Vec));
        else if (!strcmp(word, "vertex")) read_numbers(vertices[known++], 3);
        else if (!strcmp(word, "start")) {
            read_numbers(x, 3), read_numbers(q, 4), read_numbers(v, 3), read_numbers(w, 3);
            answer();
        } else if (!strcmp(word, "advance")) {
            for (read_numbers(&n, 1); n > 0; n--) step();
            answer();
        } else {
            fprintf(stderr, "unknown word: %s\n", word);
            return 2;
        }
    }
    return 0;
}
