-- time per stage: how often computed, cached and failed, seconds and memory of the computed ones
select stage,
       count(*) filter (outcome = 'computed') as computed,
       count(*) filter (outcome = 'cached') as cached,
       count(*) filter (outcome = 'failed') as failed,
       round(sum(wall_s) filter (outcome = 'computed'), 3) as wall_s,
       round(sum(cpu_s) filter (outcome = 'computed'), 3) as cpu_s,
       round(median(wall_s) filter (outcome = 'computed'), 3) as median_wall_s,
       round(max(wall_s) filter (outcome = 'computed'), 3) as longest_wall_s,
       round(max(peak_memory_mb), 1) as peak_memory_mb
from stages
group by stage
order by wall_s desc nulls last, stage
